"""What stands between the logged torque and the torque at the joint."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from impid_host.effects.effect import (
    Effect,
    Parameter,
    Setting,
    Term,
    amplitude_phase,
    each_and_all,
    each_trial,
    joint_name,
    on_joint,
)
from impid_host.effects.view import Columns, View, advanced, rate_of
from impid_host.signals.arrays import Floats
from impid_host.signals.recursive import first_order, recursive

_MAX_DELAY_S = 0.1


def _gain(setting: Setting) -> Iterator[Term]:
    if setting.bare:
        return
    for joints in each_and_all(range(setting.joints)):

        def columns(view: View, _shape: float, joints: tuple[int, ...] = joints) -> Columns:
            # The model's torque stands for the logged one: regressing the log on itself would fit anything.
            block = np.zeros((len(view.t), view.joints, len(joints)))
            for q, joint in enumerate(joints):
                block[:, joint, q] = view.torque_model[:, joint]
            return {"torque": block}

        def undo(view: View, beta: Floats, _shape: float, joints: tuple[int, ...] = joints) -> View:
            tau = view.tau.copy()
            tau[:, joints] /= 1 + beta
            return replace(view, tau=tau)

        own = Term(
            "actuator.gain",
            tuple(joint_name(joint) for joint in joints),
            columns,
            lambda beta, _shape: {"gain": _listed(1 / (1 + beta))},
            size=len(joints),
            gate=lambda beta, _shape: bool(np.max(np.abs(beta)) < 0.5),
            undo=undo,
            stretch=lambda beta, joints=joints: {  # type: ignore[misc]
                ("torque", joint): 1.0 / (1.0 + float(b)) for joint, b in zip(joints, beta, strict=True)
            },
            by_model=True,
        )
        yield own


def _listed(values: Floats) -> float | list[float]:
    return [float(v) for v in values] if len(values) > 1 else float(values[0])


def _offset(setting: Setting) -> Iterator[Term]:
    for joint in range(setting.joints):

        def columns(view: View, _shape: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, np.ones_like(view.t))

        own = Term(
            "actuator.offset",
            (joint_name(joint),),
            columns,
            lambda beta, _shape: {"torque": float(beta[0])},
        )
        yield own


def _cogging(setting: Setting) -> Iterator[Term]:
    for joint in range(setting.joints):

        def columns(view: View, cycles: float, joint: int = joint) -> Columns:
            angle = 2 * np.pi * cycles * view.theta[:, joint]
            return on_joint(view, joint, np.cos(angle), np.sin(angle))

        # A ripple of less than a cycle and a half over the range is a spring for all one can see.
        first, step = 1.5 / setting.span[joint], 0.35 / setting.span[joint]
        ripple = Term(
            "actuator.cogging",
            (joint_name(joint),),
            columns,
            _read_cogging,
            size=2,
            shapes=tuple(float(first + step * k) for k in range(50)),
        )
        yield ripple
        # Where an incremental encoder finds its zero anew, the phase is another after each power-up.
        yield each_trial(replace(ripple, shapes=ripple.shapes[::4]), setting)


def _read_cogging(beta: Floats, cycles: float) -> dict[str, float]:
    amplitude, phase = amplitude_phase(beta[0], beta[1])
    return {"amplitude": amplitude, "cycles_per_rad": cycles, "phase_rad": phase}


def _delay(setting: Setting) -> Iterator[Term]:
    for joints in each_and_all(range(setting.joints)):

        def columns(view: View, _shape: float, joints: tuple[int, ...] = joints) -> Columns:
            slope = np.zeros_like(view.torque_model)
            slope[:, joints] = rate_of(view.torque_model[:, joints], view.dt)
            return {"torque": -slope[:, :, None]}

        def late(view: View, beta: Floats, _shape: float, joints: tuple[int, ...] = joints) -> View:
            tau = view.tau.copy()
            tau[:, joints] = advanced(view.tau[:, joints], view.t, float(beta[0]))
            return replace(view, tau=tau)

        def delayed(view: View, beta: Floats, joints: tuple[int, ...] = joints) -> Columns:
            change = np.zeros_like(view.torque_model)
            own = view.torque_model[:, joints]
            change[:, joints] = advanced(own, view.t, -float(beta[0])) - own
            return {"torque": change}

        def ahead(view: View, _shape: float, joints: tuple[int, ...] = joints) -> Columns:
            return {"torque": -columns(view, _shape, joints)["torque"]}

        def lagged(view: View, beta: Floats, _shape: float, joints: tuple[int, ...] = joints) -> View:
            tau = view.tau.copy()
            tau[:, joints] = _low_passed(view.tau[:, joints], float(beta[0]), view.dt)
            return replace(view, tau=tau)

        place = tuple(joint_name(joint) for joint in joints)
        delay = Term(
            "actuator.delay",
            place,
            columns,
            lambda beta, _shape, joints=joints: {"delay": _for_each(beta, joints)},  # type: ignore[misc]
            gate=lambda beta, _shape: bool(abs(beta[0]) < _MAX_DELAY_S),
            undo=late,
            forward=delayed,
            by_model=True,
        )
        yield delay
        if not setting.bare:
            yield replace(
                delay,
                effect="actuator.lag",
                forward=None,
                columns=ahead,
                read=lambda beta, _shape, joints=joints: {"time_constant": _for_each(beta, joints)},  # type: ignore[misc]
                gate=lambda beta, _shape: bool(0 < beta[0] < _MAX_DELAY_S),
                undo=lagged,
            )


def _for_each(beta: Floats, joints: tuple[int, ...]) -> float | list[float]:
    return [float(beta[0])] * len(joints) if len(joints) > 1 else float(beta[0])


def _low_passed(values: Floats, time_constant_s: float, dt: float) -> Floats:
    """First-order lag (N, k), at rest at its first value: (1 + T d/dt) result = values."""
    if time_constant_s <= 0.0:
        return values
    return recursive(first_order(0.5 * dt / time_constant_s)[None], values, settled=True)


def _delay_of(name: str, setting: Setting) -> list[Term]:
    """The terms of one of the two, which share their first order."""
    return [term for term in _delay(setting) if term.effect == name]


_EARLIER = "a record with a sync edge in both logs, and a free trial with faster motion"
EFFECTS = (
    Effect(
        "actuator.gain",
        "true torque = gain * logged torque",
        "actuator",
        (Parameter("gain", "1", 0.5, 2.0, least=1e-3, none=1.0),),
        "Gautier and Briot, Global identification of joint drive gains, J. Dyn. Sys. 136 (2014)",
        _gain,
        tells={
            "": "a load trial with a weighed payload (payload_kg), or a known weight hung on the force sensor"
        },
    ),
    Effect(
        "actuator.offset",
        "tau += torque",
        "actuator",
        (Parameter("torque", "N*m"),),
        "Swevers, Verdonck, De Schutter, Dynamic model identification, IEEE Control Systems 27 (2007)",
        _offset,
        carries="record",
        tells={
            "gravity.tilt": "a spirit level on the table, or a free trial over a larger range of both joints"
        },
    ),
    Effect(
        "actuator.cogging",
        "tau += amplitude sin(2 pi cycles_per_rad theta + phase_rad)",
        "actuator",
        (
            Parameter("amplitude", "N*m", 0, amplitude=True),
            Parameter("cycles_per_rad", "1/rad", 0),
            Parameter("phase_rad", "rad"),
        ),
        "Holtz and Springob, IEEE Trans. Ind. Electron. 43 (1996)",
        _cogging,
    ),
    Effect(
        "actuator.delay",
        "logged torque(t) = torque(t - delay)",
        "actuator",
        (Parameter("delay", "s", -_MAX_DELAY_S, _MAX_DELAY_S, least=2e-5),),
        "study format, Conventions",
        partial(_delay_of, "actuator.delay"),
        tells={"actuator.lag": _EARLIER},
    ),
    Effect(
        "actuator.lag",
        "time_constant d(torque)/dt + torque = logged torque: the drive follows its command late",
        "actuator",
        (Parameter("time_constant", "s", 0, _MAX_DELAY_S, amplitude=True),),
        "Siciliano et al., Robotics: Modelling, Planning and Control (2009), ch. 5",
        partial(_delay_of, "actuator.lag"),
        tells={"actuator.delay": _EARLIER},
    ),
)
