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
    refuse_relative,
    with_alpha,
    with_plant_effects,
    with_terms,
)
from hil_sim.plant.physics import BUMP, INPUTS, Coupled, Slip, Term
from hil_sim.seeds import generator
from hil_sim.sensors.accelerometer import Bracket
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
    refuse_relative(truth, entry)
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


def _fading(truth: TrialTruth, entry: Entry) -> TrialTruth:
    """Magnets lose with warmth: the drives give less and less of what the log says."""
    return with_plant_effects(
        truth, fade=entry.per_joint("fade"), fade_s=entry.one("time_s"), fade_from=entry.one("warm_for_s")
    )


def _creep(truth: TrialTruth, entry: Entry) -> TrialTruth:
    return with_plant_effects(truth, creep=entry.per_joint("coefficient"))


def _cable(truth: TrialTruth, entry: Entry) -> TrialTruth:
    along = [Slip.evenly(force, entry.one("width")) for force in entry.pair("force")]
    return with_plant_effects(truth, tip_slip=(along[0], along[1]))


def _bracket(truth: TrialTruth, entry: Entry) -> TrialTruth:
    bracket = Bracket(entry.one("share"), entry.one("frequency_Hz"), entry.one("damping_ratio"))
    return replace(truth, accelerometer=replace(truth.accelerometer, bracket=bracket))


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
    Row(
        "outside.torque_constant",
        "drives that warm up give less than the log says: gain 1 - fade (1 - exp(-t / time_s)), t from when"
        " they were switched on, warm_for_s before the trial",
        JOINTS,
        (
            Parameter("fade", "1", 0.06, 0.06, 0.0),
            Parameter("time_s", "s", 30.0, 120.0, shared=True),
            Parameter("warm_for_s", "s", default=0.0),
        ),
        _fading,
    ),
    Row(
        "outside.capstan_creep",
        "the cable creeps round its capstan, so that the motor's encoder runs ahead by coefficient times"
        " torque times the way turned",
        JOINTS,
        (Parameter("coefficient", "rad/(N*m*rad)", 0.002, 0.002, 0.0),),
        _creep,
    ),
    Row(
        "outside.cable_hysteresis",
        "a bundle of cables at the end-effector drags along x and y: four springs that slip at 0.4 to"
        " 1.6 width",
        ("tip",),
        (Parameter("force", "N", 0.5, 0.5, 0.0), Parameter("width", "m", 0.01, 0.03)),
        _cable,
    ),
    Row(
        "outside.bracket",
        "the accelerometer's bracket rings: of what it measures, share goes through a resonance",
        ("sensor",),
        (
            Parameter("share", "1", 0.1, 0.1, 0.0),
            Parameter("frequency_Hz", "Hz", 3.0, 6.0),
            Parameter("damping_ratio", "1", default=0.02),
        ),
        _bracket,
    ),
)
