"""Effects that no list of hypotheses holds: what a diagnosis must not pin on the nearest known name."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.entry import (
    JOINTS,
    Entry,
    Parameter,
    Row,
    plant_effects,
    with_alpha,
    with_plant_effects,
    with_terms,
)
from hil_sim.plant.physics import BUMP, INPUTS, Coupled, Term
from hil_sim.seeds import generator
from hil_sim.world import TrialTruth

Array = NDArray[np.float64]


def _with_inputs(truth: TrialTruth, column: int, values: Array) -> TrialTruth:
    """The truth with `values`, one per tick, added to a column of what acts on the plant from outside."""
    rows = values.shape[0]
    inputs = np.zeros((rows, INPUTS)) if truth.inputs is None else truth.inputs.copy()
    inputs[:, column] += values
    # The plant looks at them where it has effects at all.
    return replace(with_plant_effects(truth), inputs=inputs)


def ticks_s(truth: TrialTruth) -> Array:
    """Instants of the controller's ticks over the trial, on the robot's clock since the start, s."""
    tick_s = truth.plant.tick_s
    return np.asarray(np.arange(round(truth.duration_s / tick_s)) * tick_s)


def _bump(truth: TrialTruth, entry: Entry) -> TrialTruth:
    columns = [entry.each(name) for name in ("torque", "centre_rad", "width_rad")]
    return with_terms(
        truth,
        [
            Term(BUMP, joint, size=torque, a=centre, b=width)
            for joint, torque, centre, width in zip(entry.joints, *columns, strict=True)
        ],
    )


def _resonance(truth: TrialTruth, entry: Entry) -> TrialTruth:
    """Part of the link's inertia hangs on a spring: alpha as measured slowly stays what it is."""
    parts = list(plant_effects(truth).resonator)
    off = {}
    columns = [entry.each(name) for name in ("inertia", "frequency_Hz", "damping_ratio")]
    for joint, inertia, frequency, ratio in zip(entry.joints, *columns, strict=True):
        omega = 2.0 * np.pi * frequency
        parts[joint] = Coupled(inertia, inertia * omega**2, 2.0 * ratio * omega * inertia)
        off[2 * joint] = -inertia
    return with_alpha(with_plant_effects(truth, resonator=(parts[0], parts[1])), off)


def _periodic(truth: TrialTruth, entry: Entry) -> TrialTruth:
    t_s = ticks_s(truth)
    for joint, torque, frequency in zip(
        entry.joints, entry.each("torque"), entry.each("frequency_Hz"), strict=True
    ):
        truth = _with_inputs(truth, joint, -torque * np.sin(2.0 * np.pi * frequency * t_s))
    return truth


def _random_walk(truth: TrialTruth, entry: Entry) -> TrialTruth:
    """A torque whose steps are independent: its standard deviation grows as the root of time."""
    source = generator(truth.seed, truth.name, "random walk")
    for joint, per_root_s in zip(entry.joints, entry.each("torque_per_root_s"), strict=True):
        steps = source.standard_normal(ticks_s(truth).size) * np.sqrt(truth.plant.tick_s)
        truth = _with_inputs(truth, joint, -per_root_s * np.cumsum(steps))
    return truth


def _warm_up(truth: TrialTruth, entry: Entry) -> TrialTruth:
    friction = list(plant_effects(truth).friction)
    columns = [entry.each(name) for name in ("torque", "viscous", "time_s")]
    for joint, torque, viscous, time_s in zip(entry.joints, *columns, strict=True):
        friction[joint] = replace(friction[joint], warm_level=torque, warm_viscous=viscous, warm_time=time_s)
    return with_plant_effects(truth, friction=(friction[0], friction[1]))


def _load_friction(truth: TrialTruth, entry: Entry) -> TrialTruth:
    friction = list(plant_effects(truth).friction)
    for joint, coefficient in zip(entry.joints, entry.each("coefficient"), strict=True):
        friction[joint] = replace(friction[joint], per_force=coefficient)
    return with_plant_effects(truth, friction=(friction[0], friction[1]))


def _clipped(truth: TrialTruth, entry: Entry) -> TrialTruth:
    return replace(truth, log=replace(truth.log, limit_Nm=entry.per_joint("torque", absent=np.inf)))


def _quantised(truth: TrialTruth, entry: Entry) -> TrialTruth:
    return replace(truth, log=replace(truth.log, quantum_Nm=entry.per_joint("torque")))


def _stuck(truth: TrialTruth, entry: Entry) -> TrialTruth:
    return replace(
        truth, log=replace(truth.log, stuck_every_s=entry.one("every_s"), stuck_s=entry.one("for_s"))
    )


def _push(truth: TrialTruth, entry: Entry) -> TrialTruth:
    """Somebody pushes for a moment: half a sine, felt by robot and force sensor alike."""
    t_s = ticks_s(truth) - entry.one("start_s")
    u = t_s / entry.one("duration_s")
    shape = np.where((u > 0.0) & (u < 1.0), np.sin(np.pi * np.clip(u, 0.0, 1.0)), 0.0)
    for axis, force in enumerate(entry.pair("force")):
        truth = _with_inputs(truth, 2 + axis, force * shape)
    return truth


def _one_trial(truth: TrialTruth, entry: Entry) -> TrialTruth:
    """Viscous friction of this trial times a factor; name the trial in `trials`."""
    factor = entry.per_joint("viscous_factor", absent=1.0)
    more = {3 + joint: (factor[joint] - 1.0) * truth.plant.alpha[3 + joint] for joint in (0, 1)}
    return with_alpha(truth, more)


EFFECTS = (
    Row(
        "outside.torque_bump",
        "the joint is hard to turn past one place: torque exp(-(theta - centre)^2 / (2 width^2))",
        JOINTS,
        (
            Parameter("torque", "N*m", 0.1, 0.1, 0.0),
            Parameter("centre_rad", "rad", 0.7, 0.9),
            Parameter("width_rad", "rad", 0.02, 0.04),
        ),
        _bump,
    ),
    Row(
        "outside.resonance",
        "part of the joint's inertia hangs on a spring with little damping",
        JOINTS,
        (
            Parameter("inertia", "kg*m^2", 0.01, 0.01, 0.0),
            Parameter("frequency_Hz", "Hz", 3.5, 4.5),
            Parameter("damping_ratio", "1", default=0.01),
        ),
        _resonance,
    ),
    Row(
        "outside.periodic",
        "a torque periodic in time resists",
        JOINTS,
        (Parameter("torque", "N*m", 0.05, 0.05, 0.0), Parameter("frequency_Hz", "Hz", 0.5, 3.0)),
        _periodic,
    ),
    Row(
        "outside.random_walk",
        "a torque that wanders: standard deviation torque_per_root_s times the root of time",
        JOINTS,
        (Parameter("torque_per_root_s", "N*m/s^0.5", 0.02, 0.02, 0.0),),
        _random_walk,
    ),
    Row(
        "outside.warm_up",
        "friction, dry and viscous, that fades as exp(-t / time_s) while the joint warms up",
        JOINTS,
        (
            Parameter("torque", "N*m", neutral=0.0, default=0.0),
            Parameter("viscous", "N*m*s/rad", 0.04, 0.04, 0.0, default=0.0),
            Parameter("time_s", "s", 5.0, 12.0),
        ),
        _warm_up,
    ),
    Row(
        "outside.load_friction",
        "dry friction of coefficient times the magnitude of the load's force",
        JOINTS,
        (Parameter("coefficient", "m", 0.005, 0.005, 0.0),),
        _load_friction,
        loaded_only=True,
    ),
    Row(
        "outside.torque_clipped",
        "the logged torque stops at this magnitude",
        JOINTS,
        (Parameter("torque", "N*m", 0.8, 0.8, 0.0, inverse=True),),
        _clipped,
    ),
    Row(
        "outside.torque_quantised",
        "the logged torque comes in steps of this",
        JOINTS,
        (Parameter("torque", "N*m", 0.3, 0.3, 0.0),),
        _quantised,
    ),
    Row(
        "outside.torque_stuck",
        "every_s on the mean, both columns of torque repeat their last value for_s long",
        ("sensor",),
        (Parameter("every_s", "s", 5.0, 5.0, 0.0, inverse=True), Parameter("for_s", "s", 0.2, 0.2)),
        _stuck,
    ),
    Row(
        "outside.push",
        "somebody pushes once, half a sine",
        ("load", "tip"),
        (
            Parameter("force", "N", 2.0, 2.0, 0.0, signed=True, pair=True),
            Parameter("start_s", "s", 8.0, 15.0),
            Parameter("duration_s", "s", 1.0, 2.0),
        ),
        _push,
    ),
    Row(
        "outside.one_trial",
        "the viscous friction of the trials named is viscous_factor times that of the others",
        JOINTS,
        (Parameter("viscous_factor", "1", 1.3, 1.3, 1.0),),
        _one_trial,
    ),
)
