"""What the load does beyond M, B and K; the physics is in load.c."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.entry import Entry, Parameter, Row, added, plant_effects, with_plant_effects
from hil_sim.errors import SimError
from hil_sim.plant.physics import JUMP, RAMP, SINE
from hil_sim.world import TrialTruth

PLACES = ("load",)


def _with_load(truth: TrialTruth, **more: Any) -> TrialTruth:
    return with_plant_effects(truth, load=replace(plant_effects(truth).load, **more))


def _matrix(entry: Entry, name: str) -> NDArray[np.float64]:
    """A number stands for that times one, a pair for a diagonal."""
    value = np.array(entry.values[name], dtype=np.float64)
    if value.shape == ():
        return np.asarray(value * np.eye(2))
    if value.shape == (2,):
        return np.diag(value)
    if value.shape != (2, 2):
        raise SimError(f"effect {entry.effect}: {name} must be a number, a pair or a 2 by 2 matrix")
    return value


def _damping(truth: TrialTruth, entry: Entry) -> TrialTruth:
    load = replace(truth.plant.load, B=truth.plant.load.B + _matrix(entry, "B"))
    return replace(truth, plant=replace(truth.plant, load=load))


def _coupling(truth: TrialTruth, entry: Entry) -> TrialTruth:
    load = truth.plant.load
    changed = replace(load, K=load.K + _matrix(entry, "K"), M=load.M + _matrix(entry, "M"))
    return replace(truth, plant=replace(truth.plant, load=changed))


def _cubic(truth: TrialTruth, entry: Entry) -> TrialTruth:
    extras = plant_effects(truth).load
    if isinstance(entry.values["cubic"], (list, tuple)):
        return _with_load(truth, cubic=added(extras.cubic, entry.pair("cubic")))
    return _with_load(truth, cubic_radial=extras.cubic_radial + entry.one("cubic"))


def _hysteresis(truth: TrialTruth, entry: Entry) -> TrialTruth:
    dry = added(plant_effects(truth).load.dry, entry.pair("amplitude"))
    return _with_load(truth, dry=dry, dry_width=entry.one("width"))


def _deadzone(truth: TrialTruth, entry: Entry) -> TrialTruth:
    width = entry.pair("width")
    return _with_load(truth, play_half=(0.5 * width[0], 0.5 * width[1]))


def _delay(truth: TrialTruth, entry: Entry) -> TrialTruth:
    step_s = truth.plant.true_tick_s / 8.0
    if entry.one("delay") < step_s:
        raise SimError(f"effect {entry.effect}: delay must be at least one step, {1e6 * step_s:.0f} us")
    return _with_load(
        truth, delay_s=entry.one("delay"), late_k=entry.one("gain_k"), late_b=entry.one("gain_b")
    )


def _drift(truth: TrialTruth, entry: Entry) -> TrialTruth:
    return _with_load(truth, drift=entry.pair("rate"), drift_from=0.5 * truth.duration_s)


COURSES = {"ramp": RAMP, "jump": JUMP, "sine": SINE}


def _time_varying(truth: TrialTruth, entry: Entry) -> TrialTruth:
    course = COURSES[str(entry.values["course"])]
    return _with_load(
        truth,
        course=course,
        course_from=0.5 * truth.duration_s,
        course_span=entry.one("period_s") if course == SINE else truth.duration_s,
        course_phase=entry.one("phase_rad"),
        **{f"more_{name}": tuple(_matrix(entry, name).ravel().tolist()) for name in ("M", "B", "K")},
    )


def _row(name: str, says: str, parameters: tuple[Parameter, ...], apply: Any) -> Row:
    return Row(name, says, PLACES, parameters, apply, loaded_only=True)


EFFECTS = (
    _row("load.damping", "a damper across the load", (Parameter("B", "N*s/m", 2.0, 2.0, 0.0),), _damping),
    _row(
        "load.stiffness_cubic",
        "the spring hardens: cubic |d|^2 d; a pair: cubic d^3 along x and along y",
        (Parameter("cubic", "N/m^3", 1e5, 1e5, 0.0, signed=True),),
        _cubic,
    ),
    _row(
        "load.hysteresis",
        "the load rubs with amplitude, built up over width after each turn, along x and along y",
        (Parameter("amplitude", "N", 0.5, 0.5, 0.0), Parameter("width", "m", 0.001, 0.003)),
        _hysteresis,
    ),
    _row(
        "load.deadzone",
        "within width about the equilibrium no spring pulls, along x and along y",
        (Parameter("width", "m", 0.004, 0.004, 0.0),),
        _deadzone,
    ),
    _row(
        "load.delay",
        "a reflex: gain_k d(t - delay) + gain_b v(t - delay)",
        (
            Parameter("delay", "s", 0.04, 0.1),
            Parameter("gain_k", "N/m", 30.0, 30.0, 0.0),
            Parameter("gain_b", "N*s/m", 1.0, 1.0, 0.0),
        ),
        _delay,
    ),
    _row(
        "load.drift",
        "the equilibrium moves at rate; it stands at x0 in the middle of the trial",
        (Parameter("rate", "m/s", 1e-4, 1e-4, 0.0, signed=True, pair=True),),
        _drift,
    ),
    _row(
        "load.coupling",
        "what is added to K and M: departures from symmetry, or from M = m 1",
        (
            Parameter("K", "N/m", 20.0, 20.0, neutral=0.0, default=0.0),
            Parameter("M", "kg", neutral=0.0, default=0.0),
        ),
        _coupling,
    ),
    _row(
        "load.time_varying",
        "K, B and M change by so much over the trial: evenly (ramp), at once in its middle (jump), or as a"
        " sine of this amplitude; on the mean they are the load's",
        (
            Parameter("K", "N/m", 40.0, 40.0, 0.0, default=0.0, signed=True),
            Parameter("B", "N*s/m", neutral=0.0, default=0.0),
            Parameter("M", "kg", neutral=0.0, default=0.0),
            Parameter("course", "", default="ramp", words=tuple(COURSES), drawn_word=True),
            Parameter("period_s", "s", 5.0, 15.0, default=10.0),
            Parameter("phase_rad", "rad", 0.0, 6.28, default=0.0),
        ),
        _time_varying,
    ),
)
