"""Dry friction and its relatives: torques that oppose the motion of a joint.

Armstrong-Helouvry, Dupont and Canudas de Wit, "A survey of models, analysis tools and compensation methods
for the control of machines with friction", Automatica 30 (1994).
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from impid_host.effects.effect import (
    Effect,
    Parameter,
    Setting,
    Term,
    Value,
    amplitude_phase,
    joint_name,
    on_joint,
)
from impid_host.effects.view import Columns, View
from impid_host.signals.arrays import Floats
from impid_host.signals.direction import sign_mean

_SOURCE = "Armstrong-Helouvry et al. 1994"
_BENDS = (
    0.0,
    1e-4,
    3e-4,
    1e-3,
    3e-3,
)  # of the range of the joint: any contact bends a little before it slides
_BEND = 5e-4  # where another parameter is sought
_ONCE = 1.2  # of the range: a period of which five sixths were visited can be told
_WIDTHS = (0.01, 0.02, 0.04, 0.08, 0.16, 0.32)  # of the range: friction that is a spring until it slides


def direction(view: View, joint: int, bend: float = 0.0) -> Floats:
    """Direction of motion, (N,); with `bend`, as a contact shows it that bends so far before it slides."""
    name = ("direction", joint, bend)
    if name not in view.memo:
        view.memo[name] = _direction(view, joint, bend)
    return view.memo[name]


def _direction(view: View, joint: int, bend: float) -> Floats:
    if bend > 0.0:
        theta, omega, acc = (values[:, joint] for values in (view.theta, view.omega, view.acc))
        # Four instants within each sample, so that a reversal between two keeps its time.
        late = view.dt * np.array([-0.375, -0.125, 0.125, 0.375])
        path = theta[:, None] + omega[:, None] * late + 0.5 * acc[:, None] * late**2
        return np.asarray(dahl(path.ravel(), bend).reshape(-1, 4).mean(axis=1))
    return sign_mean(view.omega[:, joint], view.acc[:, joint], view.dt)


def dahl(position: Floats, width: float) -> Floats:
    """Dahl's state in -1..1 along a position (N,): dz = (1 - z sign(dx)) dx / width, exact between reversals.

    Dahl, Solid friction damping of mechanical vibrations, AIAA J. 14 (1976).
    """
    turns, place = _stretches(position)
    way = np.sign(np.diff(position[turns]))
    fades = np.exp(-np.abs(np.diff(position[turns])) / width)
    states = [0.0]
    for towards, fade in zip(way.tolist(), fades.tolist(), strict=True):
        states.append(towards + (states[-1] - towards) * fade)
    begin, towards = np.array(states)[place], way[place]
    gone = np.abs(position[1:] - position[turns[place]]) / width
    return np.concatenate([[0.0], towards + (begin - towards) * np.exp(-gone)])


def _stretches(position: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Where a motion (N,) turns and ends, (k + 1,); the stretch of each instant but the first, (N - 1,)."""
    inner = np.flatnonzero(np.diff(np.sign(np.diff(position))) != 0) + 1
    turns = np.concatenate([[0], inner, [len(position) - 1]])
    return turns, np.repeat(np.arange(len(turns) - 1), np.diff(turns))


def _bends(setting: Setting, joint: int) -> tuple[float, ...]:
    return tuple(float(part * setting.span[joint]) for part in _BENDS)


def _coulomb(setting: Setting) -> Iterator[Term]:
    for joint in range(setting.joints):

        def columns(view: View, bend: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, direction(view, joint, bend))

        plain = Term(
            "friction.coulomb",
            (joint_name(joint),),
            columns,
            lambda beta, _bend: {"torque": float(beta[0])},
            shapes=_bends(setting, joint),
            fine=True,
        )
        yield plain


def _stribeck(setting: Setting) -> Iterator[Term]:
    for joint in range(setting.joints):
        for bend in (float(part * setting.span[joint]) for part in _BENDS[::2]):

            def columns(view: View, speed: float, joint: int = joint, bend: float = bend) -> Columns:
                omega = view.omega[:, joint]
                return on_joint(view, joint, direction(view, joint, bend) * np.exp(-((omega / speed) ** 2)))

            yield Term(
                "friction.stribeck",
                (joint_name(joint),),
                columns,
                lambda beta, speed: {"torque": float(beta[0]), "speed": speed},
                shapes=tuple(float(setting.speed[joint] * part) for part in np.geomspace(0.02, 0.6, 9)),
                variant=f"bends over {bend:.1g}" if bend else "",
            )


def _asymmetric(setting: Setting) -> Iterator[Term]:
    for joint in range(setting.joints):
        place = joint_name(joint)

        def columns(view: View, bend: float, joint: int = joint) -> Columns:
            way = direction(view, joint, bend)
            return on_joint(view, joint, np.maximum(way, 0), np.minimum(way, 0))

        def sloped(view: View, bend: float, joint: int = joint) -> Columns:
            way, omega = direction(view, joint, bend), view.omega[:, joint]
            return on_joint(view, joint, np.maximum(way, 0), np.minimum(way, 0), np.abs(omega))

        def slopes(view: View, _shape: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, np.abs(view.omega[:, joint]))

        plain = Term(
            "friction.asymmetric",
            (place,),
            columns,
            lambda beta, _bend: {"torque_pos": float(beta[0]), "torque_neg": float(beta[1])},
            size=2,
            shapes=_bends(setting, joint),
            fine=True,
            gate=_one_way,
            # While a joint moves, unequal dry friction is equal dry friction beside a constant torque.
            holds=(f"friction.coulomb@{place}", f"actuator.offset@{place}"),
        )
        if {"friction.coulomb", "actuator.offset"} <= setting.held:
            # The model has both parts of unequal dry friction; what it lacks is a slope that is unequal.
            yield Term("friction.asymmetric", (place,), slopes, _read_slopes, variant="slopes alone")
            continue
        yield plain
        yield replace(plain, columns=sloped, read=_read_sloped, size=3, variant="slopes too")


def _one_way(beta: Floats, _shape: float) -> bool:
    """Dry friction drives in neither direction, beyond what noise does to the smaller of the two."""
    return bool(min(beta[:2]) > -0.05 * max(beta[:2]) and max(beta[:2]) > 0)


def _read_sloped(beta: Floats, _shape: float) -> dict[str, Value]:
    """The slopes are what is to be added to the model's viscous friction in either direction."""
    pos, neg, slope = map(float, beta)
    return {"torque_pos": pos, "torque_neg": neg, "viscous_pos": slope, "viscous_neg": -slope}


def _read_slopes(beta: Floats, _shape: float) -> dict[str, Value]:
    return {"viscous_pos": float(beta[0]), "viscous_neg": -float(beta[0])}


def _quadratic(setting: Setting) -> Iterator[Term]:
    for joint in range(setting.joints):

        def columns(view: View, _shape: float, joint: int = joint) -> Columns:
            omega = view.omega[:, joint]
            return on_joint(view, joint, omega * np.abs(omega))

        yield Term(
            "friction.quadratic",
            (joint_name(joint),),
            columns,
            lambda beta, _shape: {"coefficient": float(beta[0])},
        )


def _position(setting: Setting) -> Iterator[Term]:
    """A ripple over the angle: what was not visited about once around is a slope."""
    for joint in range(setting.joints):
        bend, longest = float(_BEND * setting.span[joint]), float(_ONCE * setting.span[joint])
        for variant in ("dry", "viscous"):

            def columns(
                view: View,
                period: float,
                joint: int = joint,
                bend: float = bend,
                *,
                viscous: bool = variant == "viscous",
            ) -> Columns:
                angle = view.theta[:, joint] * (2 * np.pi / period)
                drag = view.omega[:, joint] if viscous else direction(view, joint, bend)
                return on_joint(view, joint, drag * np.cos(angle), drag * np.sin(angle))

            yield Term(
                "friction.position",
                (joint_name(joint),),
                columns,
                _read_position,
                size=2,
                shapes=tuple(float(setting.span[joint] * part) for part in np.geomspace(0.12, _ONCE, 13)),
                gate=lambda _beta, period, longest=longest: bool(period <= longest),  # type: ignore[misc]
                variant=variant,
            )


def _read_position(beta: Floats, period: float) -> dict[str, Value]:
    amplitude, phase = amplitude_phase(beta[0], beta[1])
    return {"amplitude": amplitude, "period_rad": period, "phase_rad": phase}


def _by_torque(setting: Setting) -> Iterator[Term]:
    """A bearing or a gear that is pressed harder rubs more: by the torque that passes through the joint."""
    for joint in range(setting.joints):

        def columns(view: View, bend: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, np.abs(view.torque_model[:, joint]) * direction(view, joint, bend))

        yield Term(
            "friction.load",
            (joint_name(joint),),
            columns,
            lambda beta, _bend: {"coefficient": float(beta[0])},
            shapes=_bends(setting, joint),
            fine=True,
            by_model=True,
        )


def _presliding(setting: Setting) -> Iterator[Term]:
    """Friction that is a spring until it slides, over a width that shows: one element or two of Maxwell's."""
    for joint in range(setting.joints):

        def one(view: View, width: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, direction(view, joint, width))

        def slips(view: View, width: float, joint: int = joint) -> Columns:
            # Elements that slide after width / 3 and after width: the hysteresis bends in two places.
            theta = view.theta[:, joint]
            return on_joint(view, joint, stop(theta, width / 3.0), stop(theta, width))

        # Beside dry friction that is in the model without a bend, a bend of any width is presliding.
        widths = (*_BENDS[1:], *_WIDTHS) if "friction.coulomb" in setting.held else _WIDTHS
        shapes = tuple(float(setting.span[joint] * part) for part in widths)
        place = (joint_name(joint),)
        yield Term("friction.presliding", place, one, _read_presliding, shapes=shapes, variant="Dahl")
        yield Term(
            "friction.presliding",
            place,
            slips,
            _read_presliding,
            size=2,
            shapes=shapes,
            gate=lambda beta, _width: bool(min(beta) > -0.1 * max(beta)),
            variant="Maxwell slip",
        )


def stop(position: Floats, width: float) -> Floats:
    """Prandtl's stop operator in -1..1 along a position (N,): a spring of 1 / width that slips at 1."""
    # Between reversals it goes one way, so that it slips at one end and stays there.
    turns, place = _stretches(position)
    states = [0.0]
    for move in (np.diff(position[turns]) / width).tolist():
        states.append(min(max(states[-1] + move, -1.0), 1.0))
    gone = (position[1:] - position[turns[place]]) / width
    return np.concatenate([[0.0], np.clip(np.array(states)[place] + gone, -1.0, 1.0)])


def _read_presliding(beta: Floats, width: float) -> dict[str, Value]:
    return {"torque": float(np.sum(beta)), "width_rad": width}


EFFECTS = (
    Effect(
        "friction.coulomb",
        "tau += torque sign(omega)",
        "robot",
        (Parameter("torque", "N*m", 0, amplitude=True),),
        _SOURCE,
        _coulomb,
        tells={"friction.stribeck": "a free trial with slow reversals and one with fast steady motion"},
    ),
    Effect(
        "friction.stribeck",
        "tau += torque sign(omega) exp(-(omega / speed)^2)",
        "robot",
        (Parameter("torque", "N*m", 0, amplitude=True), Parameter("speed", "rad/s", 0)),
        _SOURCE,
        _stribeck,
    ),
    Effect(
        "friction.asymmetric",
        "tau += torque_pos where omega > 0, -torque_neg where omega < 0",
        "robot",
        (
            Parameter("torque_pos", "N*m"),
            Parameter("torque_neg", "N*m"),
            Parameter("viscous_pos", "N*m*s/rad"),
            Parameter("viscous_neg", "N*m*s/rad"),
        ),
        _SOURCE,
        _asymmetric,
        tells={
            "actuator.offset": "a trial with long rests: an offset stays at standstill, dry friction does not"
        },
    ),
    Effect(
        "friction.quadratic",
        "tau += coefficient omega |omega|",
        "robot",
        (Parameter("coefficient", "N*m*s^2/rad^2", 0, amplitude=True),),
        _SOURCE,
        _quadratic,
    ),
    Effect(
        "friction.position",
        "tau += amplitude sin(2 pi theta / period_rad + phase_rad) times sign(omega), or times omega",
        "robot",
        (
            Parameter("amplitude", "N*m", 0, amplitude=True),
            Parameter("period_rad", "rad", 0),
            Parameter("phase_rad", "rad"),
        ),
        _SOURCE,
        _position,
    ),
    Effect(
        "friction.load",
        "tau += coefficient |tau| sign(omega)",
        "robot",
        (Parameter("coefficient", "N*m per N*m", 0, 1, amplitude=True),),
        "Duclusaud et al., Extended friction models (model M3), ICRA 2025",
        _by_torque,
        tells={"friction.coulomb": "free trials with and without a known payload"},
    ),
    Effect(
        "friction.presliding",
        "tau += torque z, dz = (1 - z sign(omega)) dtheta / width_rad; or springs that slip in turn",
        "robot",
        (Parameter("torque", "N*m", 0, amplitude=True), Parameter("width_rad", "rad", 0)),
        "Dahl, AIAA J. 14 (1976); Al-Bender, Lampaert, Swevers, IEEE Trans. Autom. Control 50 (2005)",
        _presliding,
        tells={"friction.coulomb": "a free trial with small slow reversals"},
    ),
)
