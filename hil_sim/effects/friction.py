"""Dry friction and its relatives, joint by joint; the physics is in friction.c."""

from dataclasses import replace
from typing import Any

from hil_sim.effects.entry import JOINTS, Entry, Parameter, Row, plant_effects, with_plant_effects, with_terms
from hil_sim.plant.physics import DRY_RIPPLE, VISCOUS_RIPPLE, Friction, Slip, Term
from hil_sim.world import TrialTruth

# Steel on steel under load bends some hundredths of a degree before it slides.
PRESLIDING = Parameter("presliding_rad", "rad", default=2e-4)


def _with_joint(truth: TrialTruth, joint: int, **more: Any) -> TrialTruth:
    both = list(plant_effects(truth).friction)
    both[joint] = replace(both[joint], **more)
    return with_plant_effects(truth, friction=(both[0], both[1]))


def _of(truth: TrialTruth, joint: int) -> Friction:
    return plant_effects(truth).friction[joint]


def _more_level(truth: TrialTruth, joint: int, pos: float, neg: float, presliding: float) -> TrialTruth:
    level = _of(truth, joint).level
    return _with_joint(truth, joint, level=(level[0] + pos, level[1] + neg), presliding=presliding)


def _coulomb(truth: TrialTruth, entry: Entry) -> TrialTruth:
    for joint, torque in zip(entry.joints, entry.each("torque"), strict=True):
        truth = _more_level(truth, joint, torque, torque, entry.one("presliding_rad"))
    return truth


def _stribeck(truth: TrialTruth, entry: Entry) -> TrialTruth:
    for joint, torque, speed in zip(entry.joints, entry.each("torque"), entry.each("speed"), strict=True):
        truth = _with_joint(
            truth,
            joint,
            stribeck=_of(truth, joint).stribeck + torque,
            stribeck_speed=speed,
            presliding=entry.one("presliding_rad"),
        )
    return truth


def _asymmetric(truth: TrialTruth, entry: Entry) -> TrialTruth:
    columns = [entry.each(name) for name in ("torque_pos", "torque_neg", "viscous_pos", "viscous_neg")]
    for joint, pos, neg, b_pos, b_neg in zip(entry.joints, *columns, strict=True):
        truth = _more_level(truth, joint, pos, neg, entry.one("presliding_rad"))
        viscous = _of(truth, joint).viscous
        truth = _with_joint(truth, joint, viscous=(viscous[0] + b_pos, viscous[1] + b_neg))
    return truth


def _quadratic(truth: TrialTruth, entry: Entry) -> TrialTruth:
    for joint, coefficient in zip(entry.joints, entry.each("coefficient"), strict=True):
        truth = _with_joint(truth, joint, quadratic=_of(truth, joint).quadratic + coefficient)
    return truth


def _position(truth: TrialTruth, entry: Entry) -> TrialTruth:
    dry = entry.values["kind"] == "dry"
    columns = [entry.each(name) for name in ("amplitude", "period_rad", "phase_rad", "torque")]
    terms = []
    for joint, amplitude, period, phase, mean in zip(entry.joints, *columns, strict=True):
        terms.append(
            Term(DRY_RIPPLE if dry else VISCOUS_RIPPLE, joint, size=amplitude, a=1.0 / period, b=phase)
        )
        if dry:
            truth = _more_level(truth, joint, mean, mean, entry.one("presliding_rad"))
    return with_terms(truth, terms)


def _load(truth: TrialTruth, entry: Entry) -> TrialTruth:
    for joint, coefficient in zip(entry.joints, entry.each("coefficient"), strict=True):
        more = _of(truth, joint).per_torque + coefficient
        truth = _with_joint(truth, joint, per_torque=more, presliding=entry.one("presliding_rad"))
    return truth


def _presliding(truth: TrialTruth, entry: Entry) -> TrialTruth:
    for joint, torque, width in zip(entry.joints, entry.each("torque"), entry.each("width_rad"), strict=True):
        if entry.values["kind"] == "dahl":
            truth = _with_joint(truth, joint, spring_level=torque, spring_width=width)
        else:
            truth = _with_joint(truth, joint, slip=Slip.evenly(torque, width))
    return truth


EFFECTS = (
    Row(
        "friction.coulomb",
        "a joint resists with a constant torque against the motion, and sticks at rest",
        JOINTS,
        (Parameter("torque", "N*m", 0.05, 0.05, 0.0), PRESLIDING),
        _coulomb,
    ),
    Row(
        "friction.stribeck",
        "so much more dry friction at standstill, which fades as exp(-(w / speed)^2)",
        JOINTS,
        (Parameter("torque", "N*m", 0.05, 0.05, 0.0), Parameter("speed", "rad/s", 0.1, 0.5), PRESLIDING),
        _stribeck,
    ),
    Row(
        "friction.asymmetric",
        "dry friction unequal in the two directions, and so drag",
        JOINTS,
        (
            Parameter("torque_pos", "N*m", 0.05, 0.1, 0.0),
            Parameter("torque_neg", "N*m", 0.0, 0.03, 0.0),
            Parameter("viscous_pos", "N*m*s/rad", neutral=0.0, default=0.0),
            Parameter("viscous_neg", "N*m*s/rad", neutral=0.0, default=0.0),
            PRESLIDING,
        ),
        _asymmetric,
    ),
    Row(
        "friction.quadratic",
        "drag that grows with the square of the speed",
        JOINTS,
        (Parameter("coefficient", "N*m*s^2/rad^2", 0.02, 0.02, 0.0),),
        _quadratic,
    ),
    Row(
        "friction.position",
        "friction that varies with the angle by amplitude sin(2 pi theta / period + phase); kind is dry or"
        " viscous, torque the dry level about which it varies",
        JOINTS,
        (
            Parameter("amplitude", "N*m or N*m*s/rad", 0.05, 0.05, 0.0),
            Parameter("period_rad", "rad", 0.25, 0.6),
            Parameter("phase_rad", "rad", 0.0, 6.28),
            Parameter("torque", "N*m", neutral=0.0, default=0.0),
            Parameter("kind", "", default="viscous", words=("dry", "viscous")),
            PRESLIDING,
        ),
        _position,
    ),
    Row(
        "friction.load",
        "dry friction of coefficient times the magnitude of the torque that passes through the joint",
        JOINTS,
        (Parameter("coefficient", "N*m per N*m", 0.05, 0.05, 0.0), PRESLIDING),
        _load,
    ),
    Row(
        "friction.presliding",
        "a spring until it slides: by Dahl's law with width_rad, or Maxwell's four slipping springs with"
        " limits of 0.4 to 1.6 width_rad",
        JOINTS,
        (
            Parameter("torque", "N*m", 0.05, 0.05, 0.0),
            Parameter("width_rad", "rad", 0.01, 0.04),
            Parameter("kind", "", default="dahl", words=("dahl", "maxwell_slip"), drawn_word=True),
        ),
        _presliding,
    ),
)
