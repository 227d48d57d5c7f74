"""What stands between the logged torque and the torque at the joint."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from impid_host.effects.effect import (
    Candidate,
    Effect,
    Parameter,
    Setting,
    amplitude_phase,
    joint_name,
    on_joint,
)
from impid_host.effects.view import Columns, View, advanced, rate_of
from impid_host.signals.arrays import Floats

_MAX_DELAY_S = 0.1


def _gain(setting: Setting) -> Iterator[Candidate]:
    for joint in range(setting.joints):

        def columns(view: View, _shape: float, joint: int = joint) -> Columns:
            # The model's torque stands for the logged one: regressing the log on itself would fit anything.
            return on_joint(view, joint, view.torque_model[:, joint])

        yield Candidate(
            "actuator.gain",
            (joint_name(joint),),
            columns,
            lambda beta, _shape: {"gain": float(1 / (1 + beta[0]))},
            gate=lambda beta, _shape: bool(abs(beta[0]) < 0.5),
            undo=lambda view, beta, joint=joint: _rescaled(view, joint, float(beta[0])),  # type: ignore[misc]
        )


def _rescaled(view: View, joint: int, excess: float) -> View:
    tau = view.tau.copy()
    tau[:, joint] /= 1 + excess
    return replace(view, tau=tau)


def _offset(setting: Setting) -> Iterator[Candidate]:
    for joint in range(setting.joints):

        def columns(view: View, _shape: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, np.ones_like(view.t))

        yield Candidate(
            "actuator.offset",
            (joint_name(joint),),
            columns,
            lambda beta, _shape: {"torque": float(beta[0])},
        )


def _cogging(setting: Setting) -> Iterator[Candidate]:
    for joint in range(setting.joints):

        def columns(view: View, cycles: float, joint: int = joint) -> Columns:
            angle = 2 * np.pi * cycles * view.theta[:, joint]
            return on_joint(view, joint, np.cos(angle), np.sin(angle))

        # A ripple of less than a cycle and a half over the range is a spring for all one can see.
        first, step = 1.5 / setting.span[joint], 0.35 / setting.span[joint]
        shapes = tuple(float(first + step * k) for k in range(50))
        yield Candidate(
            "actuator.cogging", (joint_name(joint),), columns, _read_cogging, size=2, shapes=shapes
        )


def _read_cogging(beta: Floats, cycles: float) -> dict[str, float]:
    amplitude, phase = amplitude_phase(beta[0], beta[1])
    return {"amplitude": amplitude, "cycles_per_rad": cycles, "phase_rad": phase}


def _delay(setting: Setting) -> Iterator[Candidate]:
    everywhere = tuple(range(setting.joints))
    sets = [everywhere] + ([(joint,) for joint in everywhere] if setting.joints > 1 else [])
    for joints in sets:

        def columns(view: View, _shape: float, joints: tuple[int, ...] = joints) -> Columns:
            slope = np.zeros_like(view.torque_model)
            slope[:, joints] = rate_of(view.torque_model[:, joints], view.dt)
            return {"torque": -slope[:, :, None]}

        def undo(view: View, beta: Floats, joints: tuple[int, ...] = joints) -> View:
            tau = view.tau.copy()
            tau[:, joints] = advanced(view.tau[:, joints], view.t, float(beta[0]))
            return replace(view, tau=tau)

        yield Candidate(
            "actuator.delay",
            tuple(joint_name(joint) for joint in joints),
            columns,
            lambda beta, _shape, joints=joints: {  # type: ignore[misc]
                "delay": [float(beta[0])] * len(joints) if len(joints) > 1 else float(beta[0])
            },
            gate=lambda beta, _shape: bool(abs(beta[0]) < _MAX_DELAY_S),
            undo=undo,
        )


EFFECTS = (
    Effect(
        "actuator.gain",
        "true torque = gain * logged torque",
        "actuator",
        (Parameter("gain", "1", 0.5, 2.0),),
        "Gautier and Briot, Global identification of joint drive gains, J. Dyn. Sys. 136 (2014)",
        _gain,
    ),
    Effect(
        "actuator.offset",
        "tau += torque",
        "actuator",
        (Parameter("torque", "N*m"),),
        "Swevers, Verdonck, De Schutter, Dynamic model identification, IEEE Control Systems 27 (2007)",
        _offset,
    ),
    Effect(
        "actuator.cogging",
        "tau += amplitude sin(2 pi cycles_per_rad theta + phase_rad)",
        "actuator",
        (
            Parameter("amplitude", "N*m", 0),
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
        (Parameter("delay", "s", -_MAX_DELAY_S, _MAX_DELAY_S),),
        "study format, Conventions",
        _delay,
    ),
)
