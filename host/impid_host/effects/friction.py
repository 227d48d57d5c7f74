"""Dry friction and its relatives: torques that oppose the motion of a joint.

Armstrong-Helouvry, Dupont and Canudas de Wit, "A survey of models, analysis tools and compensation methods
for the control of machines with friction", Automatica 30 (1994).
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise

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


_FINES = (1e-4, 1e-3, 1e-2)  # of the range of the joint


def _direction(view: View, joint: int, bend: float = 0.0) -> Floats:
    """Direction of motion; with `bend`, as a contact shows it that bends so far before it slides."""
    if bend > 0.0:
        theta, omega, acc = (values[:, joint] for values in (view.theta, view.omega, view.acc))
        # Four instants within each sample, so that a reversal between two keeps its time.
        late = view.dt * np.array([-0.375, -0.125, 0.125, 0.375])
        path = theta[:, None] + omega[:, None] * late + 0.5 * acc[:, None] * late**2
        return np.asarray(presliding(path.ravel(), bend).reshape(-1, 4).mean(axis=1))
    return sign_mean(view.omega[:, joint], view.acc[:, joint], view.dt)


def presliding(position: Floats, width: float) -> Floats:
    """Dahl's state in -1..1 along a position (N,): dz = (1 - z sign(dx)) dx / width, exact between reversals.

    Dahl, Solid friction damping of mechanical vibrations, AIAA J. 14 (1976).
    """
    step = np.diff(position)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(np.sign(step)) != 0) + 1, [len(step)]])
    result = np.empty(len(position))
    result[0] = state = 0.0
    for begin, end in pairwise(edges):
        towards = np.sign(step[begin]) if end > begin else 0.0
        gone = np.abs(position[begin + 1 : end + 1] - position[begin]) / width
        result[begin + 1 : end + 1] = towards + (state - towards) * np.exp(-gone)
        state = result[end]
    return result


def _bending(candidate: Candidate, columns: Callable[..., Columns], span: float) -> Candidate:
    """The candidate with the contact's bend as what the last fit may add to it."""
    fines = tuple(part * span for part in _FINES)

    def finer(bend: float) -> Candidate:
        return replace(candidate, columns=partial(columns, bend=bend), finer=finer, fines=fines)

    return replace(candidate, finer=finer, fines=fines)


def _coulomb(setting: Setting) -> Iterator[Candidate]:
    for joint in range(setting.joints):

        def columns(view: View, _shape: float, joint: int = joint, bend: float = 0.0) -> Columns:
            return on_joint(view, joint, _direction(view, joint, bend))

        plain = Candidate(
            "friction.coulomb",
            (joint_name(joint),),
            columns,
            lambda beta, _shape: {"torque": float(beta[0])},
            gate=lambda beta, _shape: bool(beta[0] > 0),
        )
        yield _bending(plain, columns, float(setting.span[joint]))


def _stribeck(setting: Setting) -> Iterator[Candidate]:
    for joint in range(setting.joints):

        def columns(view: View, speed: float, joint: int = joint, bend: float = 0.0) -> Columns:
            omega = view.omega[:, joint]
            return on_joint(view, joint, _direction(view, joint, bend) * np.exp(-((omega / speed) ** 2)))

        shapes = tuple(float(setting.speed[joint] * part) for part in np.geomspace(0.02, 0.6, 9))
        plain = Candidate(
            "friction.stribeck",
            (joint_name(joint),),
            columns,
            lambda beta, speed: {"torque": float(beta[0]), "speed": speed},
            shapes=shapes,
            gate=lambda beta, _shape: bool(beta[0] > 0),
        )
        yield _bending(plain, columns, float(setting.span[joint]))


def _asymmetric(setting: Setting) -> Iterator[Candidate]:
    for joint in range(setting.joints):

        def columns(view: View, _shape: float, joint: int = joint, bend: float = 0.0) -> Columns:
            direction = _direction(view, joint, bend)
            return on_joint(view, joint, np.maximum(direction, 0), np.minimum(direction, 0))

        plain = Candidate(
            "friction.asymmetric",
            (joint_name(joint),),
            columns,
            lambda beta, _shape: {"torque_pos": float(beta[0]), "torque_neg": float(beta[1])},
            size=2,
            gate=lambda beta, _shape: bool(min(beta) > -0.05 * max(beta) and max(beta) > 0),
        )
        yield _bending(plain, columns, float(setting.span[joint]))

        def sloped(view: View, _shape: float, joint: int = joint, bend: float = 0.0) -> Columns:
            direction, omega = _direction(view, joint, bend), view.omega[:, joint]
            return on_joint(view, joint, np.maximum(direction, 0), np.minimum(direction, 0), np.abs(omega))

        unequal = Candidate(
            "friction.asymmetric",
            (joint_name(joint),),
            sloped,
            _read_sloped,
            size=3,
            gate=lambda beta, _shape: bool(min(beta[:2]) > -0.05 * max(beta[:2]) and max(beta[:2]) > 0),
            variant="slopes too",
        )
        yield _bending(unequal, sloped, float(setting.span[joint]))


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
                view: View,
                period: float,
                joint: int = joint,
                bend: float = 0.0,
                *,
                viscous: bool = variant == "viscous",
            ) -> Columns:
                angle = view.theta[:, joint] * (2 * np.pi / period)
                drag = view.omega[:, joint] if viscous else _direction(view, joint, bend)
                return on_joint(view, joint, drag * np.cos(angle), drag * np.sin(angle))

            shapes = tuple(float(setting.span[joint] * part) for part in np.geomspace(0.12, 4.0, 18))
            plain = Candidate(
                "friction.position",
                (joint_name(joint),),
                columns,
                _read_position,
                size=2,
                shapes=shapes,
                variant=variant,
            )
            yield plain if variant == "viscous" else _bending(plain, columns, float(setting.span[joint]))


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
