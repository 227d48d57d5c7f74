"""Apparatus of several kinds with a smooth synthetic motion: what the effects' contract is tried in.

Signals are those of a model that is complete, so that what is left of them is zero until an effect is put in.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from impid_host.diagnosis.base import Base, base_of
from impid_host.diagnosis.prepare import setting_of
from impid_host.effects.effect import Setting
from impid_host.effects.view import View, rotated
from impid_host.robot.model import RobotModel, robot_model
from impid_host.robot.terms import robot_structure
from impid_host.study.model import RobotSetup

L1, L2 = 0.254, 0.2667
ALPHA = np.array([0.0693, 0.0422, 0.0442, 0.0651, 0.0739])
MOUNT_RAD = 0.4
DT = 4e-3
SECONDS = 6.0
INSIDE = slice(250, -250)  # without a second at either end, where a moved signal has no neighbours


@dataclass(frozen=True)
class Apparatus:
    """Trials, the model they follow, and what of them the catalogue asks."""

    views: tuple[View, ...]
    base: Base
    setting: Setting

    @property
    def loaded(self) -> View:
        return next((view for view in self.views if view.load is not None), self.views[0])


@dataclass(frozen=True)
class Kind:
    """A kind of apparatus, by its properties."""

    robot: str = "planar-2r-absolute"
    gravity: tuple[float, float] = (0.0, 0.0)
    trials: tuple[tuple[str, str], ...] = (
        ("free_01", "free"),
        ("spring_A_01", "mass-spring"),
        ("spring_B_01", "mass-spring"),
        ("hand_01", "arm"),
    )
    accelerometer: bool = True
    force_sensor: bool = True
    second_clock: bool = True
    referenced: bool = True


KINDS = {
    "all instruments": Kind(),
    "no accelerometer, one clock": Kind(accelerometer=False, second_clock=False),
    "no force sensor, nothing known": Kind(force_sensor=False, referenced=False),
    "free trials alone": Kind(trials=(("free_01", "free"), ("free_02", "free"))),
    "loads alone": Kind(trials=(("spring_A_01", "mass-spring"), ("spring_A_02", "mass-spring"))),
    "relative angles under gravity": Kind("planar-2r-relative", (0.0, -9.81)),
    "one joint": Kind("joint-1d", trials=(("free_01", "free"), ("hand_01", "arm"))),
    "torque at the load": Kind("joint-1d", trials=(("hand_01", "arm"), ("hand_02", "arm"))),
    "one slide": Kind("slide-1d", trials=(("free_01", "free"), ("spring_A_01", "mass-spring"))),
    "three joints": Kind("urdf"),
}


@cache
def apparatus(name: str) -> Apparatus:
    """The named kind."""
    kind = KINDS[name]
    model = _model(kind)
    views = [_view(kind, model, number) for number in range(len(kind.trials))]
    base = base_of(views, robot_structure(model))
    value = _value(base)
    views = [consistent(view, base, value) for view in views]
    return Apparatus(tuple(views), base, setting_of(views, base, referenced=kind.referenced))


def consistent(view: View, base: Base, value: np.ndarray) -> View:
    """The trial as the model at `value` would have it, without noise."""
    view = base.informed(view, value)
    assert view.respond is not None
    answer = view.respond(view)
    return replace(
        view,
        tau=answer["torque"],
        measured=view.predicted,
        theta_robot=None if view.theta_robot is None else view.theta.copy(),
        force=-answer["force"] if "force" in answer else view.force,
    )


def _model(kind: Kind) -> RobotModel:
    urdf = None
    if kind.robot == "urdf":
        urdf = Path(mkdtemp()) / "three.urdf"
        urdf.write_text(_three_joints())
    lengths = (L1, L2) if kind.robot.startswith("planar") else ()
    return robot_model(RobotSetup(kind.robot, lengths, kind.gravity, urdf))


def _three_joints() -> str:
    """A base that turns about z and two links that lift."""

    def link(name: str, mass: float) -> str:
        return (
            f'<link name="{name}"><inertial><origin xyz="0.1 0.01 0.02"/><mass value="{mass}"/>'
            '<inertia ixx="0.002" ixy="0" ixz="0" iyy="0.004" iyz="0" izz="0.005"/></inertial></link>'
        )

    def joint(name: str, parent: str, child: str, origin: str, axis: str, kind: str = "revolute") -> str:
        return (
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{origin}"/><axis xyz="{axis}"/>'
            '<limit effort="9" velocity="9" lower="-3" upper="3"/></joint>'
        )

    parts = ['<link name="base"/>', link("l1", 1.5), link("l2", 1.0), link("l3", 0.6), '<link name="tip"/>']
    parts += [
        joint("j1", "base", "l1", "0 0 0.2", "0 0 1"),
        joint("j2", "l1", "l2", "0.05 0 0.1", "0 1 0"),
        joint("j3", "l2", "l3", "0.3 0 0", "0 1 0"),
        joint("e", "l3", "tip", "0.25 0 0", "0 0 0", "fixed"),
    ]
    return f'<robot name="three">{"".join(parts)}</robot>'


def _motion(joints: int, seed: int, scale: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """t, theta, omega, acc of a few sinusoids up to 1.6 Hz, exact."""
    rng = np.random.default_rng([11, seed])
    t = np.arange(0.0, SECONDS, DT)
    w = 2 * np.pi * (np.arange(1, 9) - rng.uniform(0.0, 0.6, (joints, 8))) / 5
    p = rng.uniform(0, 2 * np.pi, (joints, 8))
    u = w[:, :, None] * t + p[:, :, None]
    centre = np.array([0.7, 0.9, 0.5])[:joints]
    theta = centre[:, None] + scale * np.sin(u).sum(1)
    omega = scale * (w[:, :, None] * np.cos(u)).sum(1)
    acc = -scale * (w[:, :, None] ** 2 * np.sin(u)).sum(1)
    return t, theta.T, omega.T, acc.T


def _view(kind: Kind, model: RobotModel, number: int) -> View:
    name, what = kind.trials[number]
    t, theta, omega, acc = _motion(model.joints, number, 0.03 if what != "free" else 0.08)
    J = model.jacobian(theta)
    a = np.einsum("kij,kj->ki", J, acc) + np.einsum("kij,kj->ki", model.jacobian_rate(theta, omega), omega)
    d = len(model.task_axes)
    planar = d == model.joints == 2
    felt = planar and kind.accelerometer
    angle = model.tip_angle(theta) + MOUNT_RAD if felt else None
    return View(
        name=name,
        kind=what,
        load=None if what == "free" else name.rsplit("_", 1)[0],
        t=t,
        dt=DT,
        theta=theta,
        omega=omega,
        acc=acc,
        tau=np.zeros_like(theta),
        x=model.position(theta),
        v=np.einsum("kij,kj->ki", J, omega),
        a=a,
        J=J,
        sensor_angle=angle,
        measured=np.zeros((len(t), 2)) if felt else None,
        predicted=None if angle is None else rotated(a - np.array(model.plane_gravity_m_s2), -angle),
        turn=model.tip_turn(omega) if felt else np.zeros(len(t)),
        turn_rate=model.tip_turn(acc) if felt else np.zeros(len(t)),
        theta_robot=theta.copy() if kind.second_clock else None,
        force=np.zeros((len(t), 2)) if kind.force_sensor and d == 2 else None,
        torque_model=np.zeros_like(theta),
        x0=np.zeros(d),
        K=np.zeros((d, d)),
        valid=np.ones(len(t), dtype=bool),
        model=model,
        zero_rad=np.full(model.joints, 0.1),
    )


def _value(base: Base) -> np.ndarray:
    """A robot and loads of ordinary size: 1 kg, 8 N s/m, 300 and 200 N/m about (0.3, 0.1, 0.2) m."""
    value = np.zeros(base.size)
    if not base.bare:
        names = base.structure.parameter_names
        value[: len(names)] = ALPHA if len(names) == len(ALPHA) else np.linspace(0.2, 0.05, len(names))
    x0 = {"x": 0.3, "y": 0.1, "z": 0.2, "theta": 0.6}
    for name, load in base.loads:
        axes = load.axes
        K = np.diag(np.linspace(300.0, 200.0, len(axes))) + 10.0 * (1 - np.eye(len(axes)))
        rest = K @ np.array([x0[axis] for axis in axes])
        for place, column in enumerate(load.columns):
            row, axis = column.entries[0]
            size = {"a": float(row == axis), "v": 8.0 * (row == axis), "x": K[row, axis], "1": rest[row]}
            value[base.slot(name).start + place] = size[column.signal]
    return value


def by_name(views: Sequence[View], name: str) -> View:
    """The named trial."""
    return next(view for view in views if view.name == name)
