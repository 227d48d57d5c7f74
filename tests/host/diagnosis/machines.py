"""Robots other than the main one, written down a second time: closed-form motion, textbook inverse dynamics.

Nothing here comes from the code under test. The two-link arm is the textbook manipulator of Siciliano et al.,
"Robotics" (2009), sec. 7.3.2; an axis is m x'' + b x'.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from impid_host.samples import DeviceSamples
from impid_host.study.model import (
    AccelerometerSetup,
    EncoderSetup,
    RobotLog,
    RobotSetup,
    Setup,
    Study,
    Trial,
)

G = 9.80665
L1, L2 = 0.30, 0.25
M1, C1, I1 = 1.2, 0.10, 0.012
M2, C2, I2 = 0.7, 0.12, 0.0065
VISCOUS = np.array([0.08, 0.05])
COUNT = 2 * np.pi / 400_000
TAU_NOISE = 0.01
MOUNT = 0.4


@dataclass(frozen=True)
class Motion:
    """Joint motion at given times, (N, n); every derivative is exact."""

    t: np.ndarray
    q: np.ndarray
    w: np.ndarray
    a: np.ndarray


@dataclass
class Case:
    """What a study is made of; `torque` hooks add to the torque, `pull` hooks to the load's -F."""

    model: str = "planar-2r-relative"
    gravity: tuple[float, float] = (0.0, 0.0)
    seed: int = 0
    seconds: float = 30.0
    free: int = 2
    loaded: int = 2
    kind: str = "mass-spring"
    device: bool = True
    force_sensor: bool = False
    prior: bool = False
    torque: list[Callable[[Motion], np.ndarray]] = field(default_factory=list)
    pull: list[Callable[..., np.ndarray]] = field(default_factory=list)
    accel_gain: float = 1.0
    late_s: float = 0.0
    quick: float = 1.0
    noise: float = TAU_NOISE


def joints_of(model: str) -> int:
    return 2 if model in ("planar-2r-relative", "urdf") else 1


def motion(rng: np.random.Generator, centre: np.ndarray, span: np.ndarray, quick: float = 1.0):
    """Ten sinusoids up to 2 Hz times `quick` per joint, with peak-to-peak `span`."""
    n = len(centre)
    w = 2 * np.pi * quick * (np.arange(1, 11) - rng.uniform(0.0, 0.6, (n, 10))) / 5
    p = rng.uniform(0, 2 * np.pi, (n, 10))
    test = np.sin(w[:, :, None] * np.arange(0, 60, 0.01) + p[:, :, None]).sum(1)
    gain = span / np.ptp(test, axis=1)

    def at(t: np.ndarray) -> Motion:
        u = w[:, :, None] * t + p[:, :, None]
        q = centre[:, None] + gain[:, None] * np.sin(u).sum(1)
        v = gain[:, None] * (w[:, :, None] * np.cos(u)).sum(1)
        a = -gain[:, None] * (w[:, :, None] ** 2 * np.sin(u)).sum(1)
        return Motion(t, q.T, v.T, a.T)

    return at


def own_torque(case: Case, m: Motion) -> np.ndarray:
    """What the robot by itself needs."""
    if joints_of(case.model) == 1:
        inertia, viscous = (12.0, 30.0) if case.model == "slide-1d" else (0.02, 0.03)
        return inertia * m.a + viscous * m.w
    (q1, q2), (v1, v2), (a1, a2) = m.q.T, m.w.T, m.a.T
    h = M2 * L1 * C2
    m11 = I1 + M1 * C1**2 + I2 + M2 * (L1**2 + C2**2) + 2 * h * np.cos(q2)
    m12 = I2 + M2 * C2**2 + h * np.cos(q2)
    m22 = I2 + M2 * C2**2
    t1 = m11 * a1 + m12 * a2 - h * np.sin(q2) * (2 * v1 * v2 + v2**2)
    t2 = m12 * a1 + m22 * a2 + h * np.sin(q2) * v1**2
    # Potential -m g . r of each link's centre of mass.
    gx, gy = case.gravity
    along1 = gx * np.sin(q1) - gy * np.cos(q1)
    along12 = gx * np.sin(q1 + q2) - gy * np.cos(q1 + q2)
    t1 = t1 + (M1 * C1 + M2 * L1) * along1 + M2 * C2 * along12
    t2 = t2 + M2 * C2 * along12
    return np.stack([t1, t2], 1) + VISCOUS * m.w


def tip(model: str, m: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place, velocity, acceleration of the end-effector, (N, d)."""
    if joints_of(model) == 1:
        return m.q, m.w, m.a
    z1, z2 = L1 * np.exp(1j * m.q[:, 0]), L2 * np.exp(1j * m.q.sum(1))
    w1, w2, a1, a2 = m.w[:, 0], m.w.sum(1), m.a[:, 0], m.a.sum(1)
    place, speed = z1 + z2, 1j * w1 * z1 + 1j * w2 * z2
    acc = (1j * a1 - w1**2) * z1 + (1j * a2 - w2**2) * z2
    return tuple(np.stack([z.real, z.imag], 1) for z in (place, speed, acc))  # type: ignore[return-value]


def by_lever(model: str, m: Motion, force: np.ndarray) -> np.ndarray:
    """Joint torques that hold `force` up at the end-effector, by virtual work."""
    if joints_of(model) == 1:
        return force
    f = force[:, 0] + 1j * force[:, 1]
    d2 = 1j * L2 * np.exp(1j * m.q.sum(1))
    d1 = 1j * L1 * np.exp(1j * m.q[:, 0]) + d2
    return np.stack([(np.conj(d1) * f).real, (np.conj(d2) * f).real], 1)


def alpha_of(case: Case) -> tuple[float, ...]:
    """The prior in the order that setup.toml's documentation gives (docs/study-format.md)."""
    if case.model == "slide-1d":
        return (12.0, 30.0)
    if case.model == "joint-1d":
        return (0.02, 0.03)
    zz1, zz2, mx2 = I1 + M1 * C1**2 + M2 * L1**2, I2 + M2 * C2**2, M2 * C2
    if case.model == "urdf":
        return (zz1, mx2, 0.0, zz2, *VISCOUS)
    heavy = (M1 * C1 + M2 * L1, 0.0) if case.gravity != (0.0, 0.0) else ()
    return (zz1, zz2, mx2, 0.0, *heavy, *VISCOUS)


def truth(case: Case, number: int) -> dict[str, np.ndarray]:
    """M, B, K of load `number`."""
    rng = np.random.default_rng([case.seed, 77, number])
    d = joints_of(case.model)
    if case.model == "joint-1d":
        return {"M": np.array([[0.03]]), "B": np.array([[0.6]]), "K": np.array([[rng.uniform(30, 60)]])}
    K = np.diag(rng.uniform(150, 500, d))
    if d == 2:
        K[0, 1] = K[1, 0] = rng.uniform(-0.2, 0.2) * K.diagonal().min()
    return {"M": rng.uniform(0.6, 1.6) * np.eye(d), "B": np.diag(rng.uniform(8, 15, d)), "K": K}


def urdf_text() -> str:
    def link(name: str, mass: float, x: float, izz: float) -> str:
        return (
            f'<link name="{name}"><inertial><origin xyz="{x} 0 0"/><mass value="{mass}"/>'
            f'<inertia ixx="0.001" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="{izz}"/></inertial></link>'
        )

    def joint(name: str, parent: str, child: str, x: float, kind: str = "revolute") -> str:
        return (
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{x} 0 0"/><axis xyz="0 0 1"/>'
            '<limit effort="9" velocity="9" lower="-3" upper="3"/></joint>'
        )

    parts = ['<link name="base"/>', link("l1", M1, C1, I1), link("l2", M2, C2, I2), '<link name="tip"/>']
    parts += [
        joint("j1", "base", "l1", 0.0),
        joint("j2", "l1", "l2", L1),
        joint("e", "l2", "tip", L2, "fixed"),
    ]
    return f'<robot name="arm">{"".join(parts)}</robot>'


def build(case: Case, folder: Path) -> Study:
    """The study; a URDF goes to `folder`."""
    rng = np.random.default_rng([case.seed, 5])
    n = joints_of(case.model)
    urdf = None
    if case.model == "urdf":
        urdf = folder / "arm.urdf"
        urdf.write_text(urdf_text())
    lengths = (L1, L2) if case.model == "planar-2r-relative" else ()
    step = 1e-6 if case.model == "slide-1d" else COUNT
    setup = Setup(
        robot=RobotSetup(case.model, lengths, case.gravity, urdf),
        prior_alpha=alpha_of(case) if case.prior else None,
    )
    if case.device:
        setup = replace(
            setup,
            encoder=EncoderSetup((2 * np.pi / step,) * n, (0.0,) * n, (1,) * n),
            accelerometer=AccelerometerSetup(
                "ADXL203", 3.3, 65536, (1.65, 1.65), (0.62, 0.62), "link2", MOUNT
            ),
        )
    trials = []
    for index in range(case.free + case.loaded):
        number = index - case.free
        centre = np.array([0.6, 0.9])[:n] + (rng.uniform(-0.15, 0.15, n) if number >= 0 else 0)
        if case.model == "slide-1d":
            centre, span = np.zeros(1), np.array([0.05 if number >= 0 else 0.2])
        else:
            span = np.deg2rad(np.full(n, 10.0 if number >= 0 else 40.0))
        at = motion(rng, centre, span, case.quick)
        load = truth(case, number) if number >= 0 else None
        name = f"{'hand' if case.kind == 'arm' else 'spring'}_{'AB'[number % 2]}_{number + 1:02d}"
        name = name if number >= 0 else f"free_{index + 1:02d}"
        kind = case.kind if number >= 0 else "free"
        trials.append(_record(case, rng, at, centre, load, name, kind, step, 20.0 + 60 * index))
    return Study(f"{case.model} {case.seed}", setup, tuple(sorted(trials, key=lambda trial: trial.name)))


def _torque(case: Case, m: Motion, centre: np.ndarray, load: dict[str, np.ndarray] | None):
    tau = own_torque(case, m)
    for hook in case.torque:
        tau = tau + hook(m)
    x, v, a = tip(case.model, m)
    if load is None:
        return tau, np.zeros_like(x)
    still = np.zeros((1, len(centre)))
    x0 = tip(case.model, Motion(np.zeros(1), centre[None], still, still))[0]
    pull = a @ load["M"].T + (x - x0) @ load["K"].T
    if case.kind == "arm":
        pull = pull + v @ load["B"].T
    if len(centre) == 2:
        pull = pull - load["M"][0, 0] * np.array(case.gravity)
    for hook in case.pull:
        pull = pull + hook(m.t, x - x0, v, load)
    return tau + by_lever(case.model, m, pull), -pull


def _record(case, rng, at, centre, load, name, kind, step, offset) -> Trial:
    rate = 1 + 60e-6
    t = np.arange(0.05, case.seconds, 1e-3)
    m = at(t)
    tau, _ = _torque(case, at(t - case.late_s), centre, load)
    _, force = _torque(case, m, centre, load)
    scale = 100.0 if case.model == "slide-1d" else 1.0
    tau = tau + rng.normal(0, case.noise * scale, tau.shape)
    planar = force.shape[1] == 2
    log = RobotLog(
        t=t,
        theta=np.round(m.q / step) * step,
        tau=tau,
        force=force + rng.normal(0, 0.03, force.shape) if case.force_sensor and planar else None,
    )
    device = _module(case, rng, at, step, offset, rate) if case.device else None
    return Trial(name, kind, name.rsplit("_", 1)[0], log, device)


def _module(case, rng, at, step, offset, rate) -> DeviceSamples:
    t_us = np.arange(np.ceil((offset + 0.4) * 1e6), (offset + case.seconds) * 1e6, 1000).astype(np.uint64)
    m = at((t_us * 1e-6 - offset) / rate)
    felt = np.zeros((len(m.t), 2))
    if m.q.shape[1] == 2:
        _, _, a = tip(case.model, m)
        a = a - np.array(case.gravity)
        z = (a[:, 0] + 1j * a[:, 1]) * np.exp(-1j * (m.q.sum(1) + MOUNT))
        felt = np.stack([case.accel_gain * z.real, z.imag], 1)
    felt = felt + rng.normal(0, 0.03, felt.shape)
    codes = np.round((1.65 + felt / G * 0.62) / 3.3 * 65536).astype(np.uint16)
    counts = np.round(m.q / step).astype(np.int32)
    return DeviceSamples(
        t_us=t_us,
        seq=np.arange(len(t_us), dtype=np.uint32),
        ax=codes[:, 0],
        ay=codes[:, 1],
        enc1=counts[:, 0],
        enc2=counts[:, -1],
        flags=np.zeros(len(t_us), dtype=np.uint8),
    )


def on_joint(joint: int, torque: Callable[[np.ndarray, np.ndarray], np.ndarray]):
    """A torque of angle and speed on one joint."""

    def hook(m: Motion) -> np.ndarray:
        out = np.zeros_like(m.q)
        out[:, joint] = torque(m.q[:, joint], m.w[:, joint])
        return out

    return hook
