"""Springs, dampers, masses and gravity that the robot model lacks; the physics is in joint.c and tip.c."""

from dataclasses import replace

from hil_sim.effects.entry import (
    JOINTS,
    Entry,
    Parameter,
    Row,
    added,
    plant_effects,
    refuse_relative,
    with_alpha,
    with_plant_effects,
    with_terms,
)
from hil_sim.errors import SimError
from hil_sim.plant.physics import SPRING, Coupled, Term
from hil_sim.world import TrialTruth

Matrix = tuple[float, float, float, float]


def _sum(one: Matrix, other: Matrix) -> Matrix:
    return one[0] + other[0], one[1] + other[1], one[2] + other[2], one[3] + other[3]


def _elastic_cartesian(truth: TrialTruth, entry: Entry) -> TrialTruth:
    kx, ky, kxy = entry.one("kx"), entry.one("ky"), entry.one("kxy")
    x0, y0 = entry.one("x0"), entry.one("y0")
    pull = (kx * x0 + kxy * y0, kxy * x0 + ky * y0)
    so_far = plant_effects(truth)
    return with_plant_effects(
        truth,
        tip_stiffness=_sum(so_far.tip_stiffness, (kx, kxy, kxy, ky)),
        tip_pull=added(so_far.tip_pull, pull),
    )


def _elastic_joint(truth: TrialTruth, entry: Entry) -> TrialTruth:
    columns = zip(entry.joints, entry.each("stiffness"), entry.each("rest_rad"), strict=True)
    return with_terms(truth, [Term(SPRING, joint, size=k, a=rest, b=0.0) for joint, k, rest in columns])


def _transmission(truth: TrialTruth, entry: Entry) -> TrialTruth:
    """The motor's inertia is part of alpha as measured, so it is taken off the link's."""
    refuse_relative(truth, entry)
    motor = list(plant_effects(truth).motor)
    off = {}
    columns = [entry.each(name) for name in ("stiffness", "motor_inertia", "damping_ratio")]
    for joint, stiffness, inertia, ratio in zip(entry.joints, *columns, strict=True):
        motor[joint] = Coupled(inertia, stiffness, 2.0 * ratio * (stiffness * inertia) ** 0.5)
        off[2 * joint] = -inertia
    return with_alpha(with_plant_effects(truth, motor=(motor[0], motor[1])), off)


def _damping_cartesian(truth: TrialTruth, entry: Entry) -> TrialTruth:
    more = (entry.one("bx"), 0.0, 0.0, entry.one("by"))
    return with_plant_effects(truth, tip_damping=_sum(plant_effects(truth).tip_damping, more))


def _tilt(truth: TrialTruth, entry: Entry) -> TrialTruth:
    """Gravity pulls at links and payload, and the accelerometer feels its opposite."""
    gravity = (entry.one("gx"), entry.one("gy"))
    so_far = plant_effects(truth)
    moment = tuple(entry.values["moment_kg_m"]) or (
        so_far.moment if any(so_far.moment) else truth.plant.likely_moments_kg_m
    )
    gravity = added(so_far.gravity, gravity)
    truth = with_plant_effects(truth, gravity=gravity, moment=(float(moment[0]), float(moment[1])))
    return replace(truth, accelerometer=replace(truth.accelerometer, gravity_m_s2=gravity))


def _inertia(truth: TrialTruth, entry: Entry) -> TrialTruth:
    """A mass at the end point, or a rotor on a joint's own axis, is exactly a change of alpha.

    A rotor that both joints turn, geared, also couples them by a constant.
    """
    if entry.where == ("tip",):
        l1, l2 = truth.plant.link_lengths_m
        mass = entry.one("mass")
        return with_alpha(truth, {0: mass * l1**2, 1: 2.0 * mass * l1 * l2, 2: mass * l2**2})
    coupling = entry.one("coupling")
    if coupling and len(entry.where) < 2:
        raise SimError(f"effect {entry.effect}: coupling is between two joints; name both in where")
    inertia = entry.per_joint("inertia")
    if truth.plant.relative:
        # A rotor on the second joint turns against the first link.
        inertia, coupling = (inertia[0] + inertia[1], inertia[1]), coupling - inertia[1]
    truth = with_alpha(truth, {0: inertia[0], 2: inertia[1]})
    if not coupling:
        return truth
    return with_plant_effects(truth, inertia12=plant_effects(truth).inertia12 + coupling)


def _weight(truth: TrialTruth, entry: Entry) -> TrialTruth:
    so_far = plant_effects(truth)
    sine, cosine = entry.per_joint("torque_sin"), entry.per_joint("torque_cos")
    if truth.plant.relative:
        # The second link's own angle is a quarter turn behind that of the plant.
        sine, cosine = (sine[0], cosine[1]), (cosine[0], -sine[1])
    return with_plant_effects(
        truth, weight_sin=added(so_far.weight_sin, sine), weight_cos=added(so_far.weight_cos, cosine)
    )


EFFECTS = (
    Row(
        "elastic.cartesian",
        "springs (cables) pull the end-effector towards x0, y0, ahead of any force sensor",
        ("tip",),
        (
            Parameter("kx", "N/m", 20.0, 40.0, 0.0),
            Parameter("ky", "N/m", 5.0, 15.0, 0.0),
            Parameter("x0", "m", 0.3, 0.4, default=0.0),
            Parameter("y0", "m", -0.05, 0.05, default=0.0),
            Parameter("kxy", "N/m", 2.0, 8.0, 0.0, default=0.0, signed=True),
        ),
        _elastic_cartesian,
    ),
    Row(
        "elastic.joint",
        "a spring about the joint's axis",
        JOINTS,
        (Parameter("stiffness", "N*m/rad", 1.0, 1.0, 0.0), Parameter("rest_rad", "rad", 0.5, 1.0)),
        _elastic_joint,
    ),
    Row(
        "elastic.transmission",
        "the motor drives the joint through a spring; encoders sit at the joint, the drive watches its motor",
        JOINTS,
        (
            Parameter("stiffness", "N*m/rad", 30.0, 30.0, 0.0, inverse=True),
            Parameter("motor_inertia", "kg*m^2", 0.01, 0.01),
            Parameter("damping_ratio", "1", default=0.05),
        ),
        _transmission,
    ),
    Row(
        "damping.cartesian",
        "a damper at the end-effector, ahead of any force sensor",
        ("tip",),
        (Parameter("bx", "N*s/m", 1.0, 3.0, 0.0), Parameter("by", "N*s/m", 1.0, 3.0, 0.0)),
        _damping_cartesian,
    ),
    Row(
        "gravity.tilt",
        "the plane is not level: gravity on links and payload, and in the accelerometer; moment_kg_m are the"
        " first moments of the links",
        ("tip",),
        (
            Parameter("gx", "m/s^2", -0.2, 0.2, 0.0),
            Parameter("gy", "m/s^2", -0.2, 0.2, 0.0),
            Parameter("moment_kg_m", "kg*m", default=()),
        ),
        _tilt,
    ),
    Row(
        "inertia.extra",
        "a mass at the end-effector ahead of any force sensor, or a rotor's inertia on a joint's axis;"
        " coupling is that of a rotor which both joints turn",
        ("tip", *JOINTS),
        (
            Parameter("mass", "kg", 0.05, 0.05, 0.0, default=0.0),
            Parameter("inertia", "kg*m^2", 0.005, 0.005, 0.0, default=0.0),
            Parameter("coupling", "kg*m^2", 0.003, 0.003, 0.0, default=0.0, signed=True, shared=True),
        ),
        _inertia,
    ),
    Row(
        "gravity.link",
        "weight of the link behind the joint, which resists with torque_sin sin + torque_cos cos of the"
        " link's angle; payload and sensor do not feel it",
        JOINTS,
        (
            Parameter("torque_sin", "N*m", 0.02, 0.05, 0.0, default=0.0, signed=True),
            Parameter("torque_cos", "N*m", 0.02, 0.05, 0.0, default=0.0, signed=True),
        ),
        _weight,
    ),
)
