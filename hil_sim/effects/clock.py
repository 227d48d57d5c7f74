"""The robot's clock drifts within a trial in a way that no constant rate describes."""

from dataclasses import replace

from hil_sim.effects.entry import Entry, Parameter, Row
from hil_sim.world import TrialTruth


def _drift(truth: TrialTruth, entry: Entry) -> TrialTruth:
    value = entry.values["seconds"]
    more = [float(one) for one in value] if isinstance(value, (list, tuple)) else [float(value)]
    so_far = list(truth.robot_clock.drift_s)
    size = max(len(more), len(so_far))
    padded = [part + [0.0] * (size - len(part)) for part in (so_far, more)]
    drift = tuple(a + b for a, b in zip(*padded, strict=True))
    swing = {
        "swing_s": entry.one("wander"),
        "swing_period_s": entry.one("period_s"),
        "swing_phase_rad": entry.one("phase_rad"),
    }
    clock = replace(truth.robot_clock, drift_s=drift, span_s=truth.duration_s, **swing)
    return replace(truth, robot_clock=clock)


EFFECTS = (
    Row(
        "clock.drift",
        "the robot's clock is ahead by seconds times a Legendre polynomial of degree 2 (3, ...) in time, and"
        " by wander sin(2 pi t / period_s + phase_rad) less its straight line",
        ("sensor",),
        (
            Parameter("seconds", "s", 0.003, 0.003, 0.0, default=0.0, signed=True),
            Parameter("wander", "s", 0.003, 0.003, 0.0, default=0.0),
            Parameter("period_s", "s", 15.0, 40.0, default=30.0),
            Parameter("phase_rad", "rad", 0.0, 6.28, default=0.0),
        ),
        _drift,
    ),
)
