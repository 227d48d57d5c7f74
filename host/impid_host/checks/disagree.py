"""What still contradicts itself when no discrete mistake explains it: a disagreement, without a cause."""

from collections.abc import Iterator

import numpy as np

from impid_host.checks.axes import AxisMap
from impid_host.checks.check import Change, Check
from impid_host.checks.equations import Motions
from impid_host.checks.force_lag import Lag, force_lag
from impid_host.checks.joint_fit import JointFit
from impid_host.checks.looks import RESTS
from impid_host.checks.mistakes import accelerometer, force
from impid_host.checks.signals import Signals
from impid_host.study.model import STANDARD_GRAVITY_M_S2, AccelerometerSetup, Setup

# Half of what is worth a word by itself (5 % of K or M), and far outside of what noise does.
LEAST = 0.04
SIGMAS = 8.0
_CLOCKS = 0.05
GRAVE = 0.3
_HARDLY = 0.7
_LAG_S = 0.3e-3
_LAG_SIGMAS = 5.0
ZERO_G_M_S2 = 2.5
FORCE_ZERO_N = 2.0
_SHARE_OF_FORCE = 0.3


def disagreements(study: Signals, fit: JointFit, motions: Motions, setup: Setup) -> Iterator[Check]:
    """The pairs of measurements that do not agree, and what physics refuses, with no mistake behind it."""
    adequate = all(r < GRAVE for channel, r in fit.left.items() if channel.startswith("tau"))
    for violation in fit.violations:
        # What a model that leaves so much comes to is no number; the fit's own gate judges its own.
        if violation.odd_size or not adequate:
            continue
        yield Check(
            "result.impossible",
            violation.where,
            "impossible",
            f"{violation.words}, and no single mistake explains it",
            {"value": violation.value},
            "look at signs, units and order of the channels; `impid-host info` lists what was read",
        )
    for violation in fit.violations:
        if violation.odd_size:
            yield Check(
                "torque.unit",
                violation.where,
                "suspect",
                violation.words,
                {"value": violation.value},
                "check the unit of tau (N m), of angles (rad) and of lengths (m)",
            )
    if study.planar:
        felt = accelerometer.acceleration_map(study, motions, study.mount)
        yield from _accelerations(felt)
        yield from _zero_g(felt, setup.accelerometer)
        robot = force.by_torques(study, motions) if force.has_force(study) else None
        if robot is not None:
            found = force.force_map(study, motions, robot, study.force_frame)
            yield from _forces(found)
            yield from _late_force(force_lag(study, motions, robot))
            yield from _force_zero(study, found)
    yield from _angles(fit)
    yield from _unexplained(study, fit)


def _far(found: AxisMap) -> bool:
    return found.deviation > max(LEAST, SIGMAS * found.sd)


def _accelerations(found: AxisMap | None) -> Iterator[Check]:
    if found is not None and _far(found):
        yield Check(
            "accelerations.disagree",
            "sensor",
            "contradiction",
            f"accelerometer and encoders differ by up to {100 * found.deviation:.1f} % (standard error "
            f"{100 * found.sd:.2g} %)",
            {"map": np.round(found.raw, 4), "standard_error": found.sd},
            "run `impid-host diagnose`: the sensor's gain or place, a link's length or an encoder may be off",
        )


def _forces(found: AxisMap | None) -> Iterator[Check]:
    if found is not None and _far(found):
        yield Check(
            "methods.disagree",
            "",
            "contradiction",
            f"force sensor and torques differ by up to {100 * found.deviation:.1f} % (standard error "
            f"{100 * found.sd:.2g} %), and Methods 1 and 2 with them",
            {"map": np.round(found.raw, 4), "standard_error": found.sd},
            "run `impid-host diagnose`: an effect that the model lacks may be behind it",
        )


def _late_force(lag: Lag | None) -> Iterator[Check]:
    """Damping by Method 2 is off by K times the lag, which the readings' own noise does not tell."""
    if lag is None or abs(lag.seconds) < max(_LAG_S, _LAG_SIGMAS * lag.sd):
        return
    late = "late" if lag.seconds > 0 else "early"
    yield Check(
        "methods.disagree",
        "sensor",
        "suspect",
        f"the force sensor is {1e3 * abs(lag.seconds):.2f} +- {1.96e3 * lag.sd:.2g} ms {late} against the "
        f"torques: by Method 2 damping is off by K times that",
        {"lag_s": lag.seconds, "standard_error_s": lag.sd},
        "take B from Method 1, or run `impid-host diagnose` (force.delay); log means over the sample period",
    )


def _zero_g(found: AxisMap | None, sensor: AccelerometerSetup | None) -> Iterator[Check]:
    """A level sensor at rest feels nothing along its axes."""
    if found is None or sensor is None or float(np.abs(found.bias).max()) < ZERO_G_M_S2:
        return
    s = np.array(sensor.sensitivity_V_per_g)
    new = np.round(np.array(sensor.zero_g_V) + found.bias / STANDARD_GRAVITY_M_S2 * s, 4).tolist()
    axes = [axis for axis, bias in zip("xy", found.bias, strict=True) if abs(bias) > ZERO_G_M_S2]
    yield Check(
        "accel.unit",
        "sensor" if len(axes) == 2 else axes[0],
        "contradiction",
        f"the accelerometer's zero is off by {found.bias[0]:.2f} and {found.bias[1]:.2f} m/s^2: a "
        "level sensor feels nothing at rest",
        {"bias_m_s2": found.bias},
        f"setup.toml: [accelerometer] zero_g_V = {new}; or vref_V, if another supply was used",
        (Change("accelerometer", "zero_g_V", new),),
    )


def _force_zero(study: Signals, found: AxisMap | None) -> Iterator[Check]:
    free = [trial.force for trial in study.trials if trial.kind == "free" and trial.force is not None]
    loaded = [trial.force for trial in study.trials if trial.kind != "free" and trial.force is not None]
    if free:
        bias = np.concatenate(free).mean(axis=0)
    elif found is not None:
        bias = found.bias
    else:
        return
    size = float(np.sqrt(np.mean([np.var(force) for force in loaded])))
    if float(np.abs(bias).max()) > max(FORCE_ZERO_N, _SHARE_OF_FORCE * size):
        yield Check(
            "force.bias",
            "sensor",
            "contradiction",
            f"the force sensor reads {bias[0]:.2f} and {bias[1]:.2f} N where nothing pulls at it",
            {"bias_N": bias},
            'robot.csv, or the mapping it is imported by: fx = { column = "...", offset = '
            f"{-bias[0]:.3f} }}, fy likewise {-bias[1]:.3f}; zero the sensor before a session",
        )


def _unexplained(study: Signals, fit: JointFit) -> Iterator[Check]:
    """So much of a channel contradicts the rest that something is wrong, whatever it is."""
    named = {"tau": "trials.disagree", "f": "methods.disagree", "a": "accelerations.disagree"}
    resting = {f"tau{joint + 1}" for joint in range(study.model.joints) if _rests(study, joint)}
    for start, what in named.items():
        off = {
            channel: r
            for channel, r in fit.left.items()
            if channel.startswith(start) and r > GRAVE and channel.split()[0] not in resting
        }
        if off:
            worst = max(off, key=lambda channel: off[channel])
            # One trial disagrees with nothing: what a weak joint leaves may be its friction or its noise.
            alone = start == "tau" and len(study.trials) < 2 and off[worst] < _HARDLY
            yield Check(
                what,
                "",
                "suspect" if alone else "contradiction",
                f"{100 * off[worst]:.0f} % of {worst} contradicts the rest of the study, and no single "
                "mistake explains it",
                {"left": off},
                "look at each trial's label, and at signs, units and order of the channels; then run "
                "`impid-host diagnose`",
            )


def _rests(study: Signals, joint: int) -> bool:
    return all(float(np.ptp(trial.theta[:, joint])) < RESTS for trial in study.trials)


def _angles(fit: JointFit) -> Iterator[Check]:
    for channel, r in fit.left.items():
        joint = f"joint{channel[-1]}"
        if channel.startswith("theta") and r > _CLOCKS:
            yield Check(
                "clocks.disagree",
                joint,
                "contradiction",
                f"module and controller read one encoder, and {100 * r:.1f} % of joint {channel[-1]}'s "
                "motion differs between them",
                {"share": r},
                "run `impid-host diagnose`: the clocks may drift, or an encoder miss counts",
            )
