"""Dry friction and its relatives: torques that oppose the motion of a joint.

Armstrong-Helouvry, Dupont and Canudas de Wit, "A survey of models, analysis tools and compensation methods
for the control of machines with friction", Automatica 30 (1994).
"""

from collections.abc import Iterator

import numpy as np

from impid_host.effects.effect import (
    Candidate,
    Effect,
    Parameter,
    Setting,
    amplitude_phase,
    joint_name,
    on_joint,
    sign_mean,
)
from impid_host.effects.view import Columns, View
from impid_host.signals.arrays import Floats

_SOURCE = "Armstrong-Helouvry et al. 1994"


def _direction(view: View, joint: int) -> Floats:
    return sign_mean(view.omega[:, joint], view.acc[:, joint], view.dt)


def _coulomb(setting: Setting) -> Iterator[Candidate]:
    for joint in range(setting.joints):

        def columns(view: View, _shape: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, _direction(view, joint))

        yield Candidate(
            "friction.coulomb",
            (joint_name(joint),),
            columns,
            lambda beta, _shape: {"torque": float(beta[0])},
            gate=lambda beta, _shape: bool(beta[0] > 0),
        )


def _stribeck(setting: Setting) -> Iterator[Candidate]:
    for joint in range(setting.joints):

        def columns(view: View, speed: float, joint: int = joint) -> Columns:
            omega = view.omega[:, joint]
            return on_joint(view, joint, _direction(view, joint) * np.exp(-((omega / speed) ** 2)))

        shapes = tuple(float(setting.speed[joint] * part) for part in np.geomspace(0.02, 0.6, 9))
        yield Candidate(
            "friction.stribeck",
            (joint_name(joint),),
            columns,
            lambda beta, speed: {"torque": float(beta[0]), "speed": speed},
            shapes=shapes,
            gate=lambda beta, _shape: bool(beta[0] > 0),
        )


def _asymmetric(setting: Setting) -> Iterator[Candidate]:
    for joint in range(setting.joints):

        def columns(view: View, _shape: float, joint: int = joint) -> Columns:
            direction = _direction(view, joint)
            return on_joint(view, joint, np.maximum(direction, 0), np.minimum(direction, 0))

        yield Candidate(
            "friction.asymmetric",
            (joint_name(joint),),
            columns,
            lambda beta, _shape: {"torque_pos": float(beta[0]), "torque_neg": float(beta[1])},
            size=2,
            gate=lambda beta, _shape: bool(min(beta) > -0.05 * max(beta) and max(beta) > 0),
        )

        def sloped(view: View, _shape: float, joint: int = joint) -> Columns:
            direction, omega = _direction(view, joint), view.omega[:, joint]
            return on_joint(view, joint, np.maximum(direction, 0), np.minimum(direction, 0), np.abs(omega))

        yield Candidate(
            "friction.asymmetric",
            (joint_name(joint),),
            sloped,
            _read_sloped,
            size=3,
            gate=lambda beta, _shape: bool(min(beta[:2]) > -0.05 * max(beta[:2]) and max(beta[:2]) > 0),
            variant="slopes too",
        )


def _read_sloped(beta: Floats, _shape: float) -> dict[str, float]:
    """The slopes are what is to be added to the model's viscous friction in either direction."""
    pos, neg, slope = map(float, beta)
    return {"torque_pos": pos, "torque_neg": neg, "viscous_pos": slope, "viscous_neg": -slope}


def _quadratic(setting: Setting) -> Iterator[Candidate]:
    for joint in range(setting.joints):

        def columns(view: View, _shape: float, joint: int = joint) -> Columns:
            omega = view.omega[:, joint]
            return on_joint(view, joint, omega * np.abs(omega))

        yield Candidate(
            "friction.quadratic",
            (joint_name(joint),),
            columns,
            lambda beta, _shape: {"coefficient": float(beta[0])},
            gate=lambda beta, _shape: bool(beta[0] > 0),
        )


def _position(setting: Setting) -> Iterator[Candidate]:
    for joint in range(setting.joints):
        for variant in ("dry", "viscous"):

            def columns(
                view: View, period: float, joint: int = joint, *, viscous: bool = variant == "viscous"
            ) -> Columns:
                angle = view.theta[:, joint] * (2 * np.pi / period)
                drag = view.omega[:, joint] if viscous else _direction(view, joint)
                return on_joint(view, joint, drag * np.cos(angle), drag * np.sin(angle))

            shapes = tuple(float(setting.span[joint] * part) for part in np.geomspace(0.12, 4.0, 18))
            yield Candidate(
                "friction.position",
                (joint_name(joint),),
                columns,
                _read_position,
                size=2,
                shapes=shapes,
                variant=variant,
            )


def _read_position(beta: Floats, period: float) -> dict[str, float]:
    amplitude, phase = amplitude_phase(beta[0], beta[1])
    return {"amplitude": amplitude, "period_rad": period, "phase_rad": phase}


EFFECTS = (
    Effect(
        "friction.coulomb",
        "tau += torque sign(omega)",
        "robot",
        (Parameter("torque", "N*m", 0),),
        _SOURCE,
        _coulomb,
    ),
    Effect(
        "friction.stribeck",
        "tau += torque sign(omega) exp(-(omega / speed)^2)",
        "robot",
        (Parameter("torque", "N*m", 0), Parameter("speed", "rad/s", 0)),
        _SOURCE,
        _stribeck,
    ),
    Effect(
        "friction.asymmetric",
        "tau += torque_pos where omega > 0, -torque_neg where omega < 0",
        "robot",
        (
            Parameter("torque_pos", "N*m", 0),
            Parameter("torque_neg", "N*m", 0),
            Parameter("viscous_pos", "N*m*s/rad"),
            Parameter("viscous_neg", "N*m*s/rad"),
        ),
        _SOURCE,
        _asymmetric,
    ),
    Effect(
        "friction.quadratic",
        "tau += coefficient omega |omega|",
        "robot",
        (Parameter("coefficient", "N*m*s^2/rad^2", 0),),
        _SOURCE,
        _quadratic,
    ),
    Effect(
        "friction.position",
        "tau += amplitude sin(2 pi theta / period_rad + phase_rad) times sign(omega), or times omega",
        "robot",
        (
            Parameter("amplitude", "N*m", 0),
            Parameter("period_rad", "rad", 0),
            Parameter("phase_rad", "rad"),
        ),
        _SOURCE,
        _position,
    ),
)
