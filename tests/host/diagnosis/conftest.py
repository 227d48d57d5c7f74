"""A study generator that shares nothing with impid: motions in closed form, torques by inverse dynamics.

The motion is a sum of sinusoids, so every derivative is exact; the robot is two rods with their textbook
equations (Lagrange, worked by hand in complex numbers), and each effect is put in as physics.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
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
from scipy.signal import lfilter

L1, L2 = 0.254, 0.2667
COUNT = 2 * np.pi / 400_000
G = 9.80665

Law = Callable[..., Any]


@dataclass
class World:
    """One study's truth; hooks are the effects, each does nothing by default."""

    seed: int
    duration: float = 20.0
    free: int = 2
    loaded: int = 2
    same_load: bool = False
    repeat: bool = False  # every trial of a kind makes the same motion
    force_sensor: bool = False
    device: bool = True
    torque_noise: float = 0.01
    noise_kind: str = "white"
    torque: list[Law] = field(default_factory=list)  # (m, rng) -> (N, 2) joint torque needed
    load_force: list[Law] = field(default_factory=list)  # (m, load) -> (N, 2) added to -F_ext
    tip_force: list[Law] = field(default_factory=list)  # (m, load) -> (N, 2) force the robot must overcome
    gain: tuple[float, float] = (1.0, 1.0)  # true / logged
    delay: float = 0.0
    accel_gain: tuple[float, float] = (1.0, 1.0)
    accel_bias: tuple[float, float] = (0.0, 0.0)
    accel_cross: tuple[float, float] = (0.0, 0.0)
    accel_angle: float = 0.0
    accel_delay: float = 0.0
    accel_lever: tuple[float, float] = (0.0, 0.0)
    gravity: tuple[float, float] = (0.0, 0.0)
    moments: tuple[float, float] = (0.2, 0.08)  # kg m, first moments of the links
    encoder_error: Law = lambda theta: 0 * theta
    clock_error: Law = lambda t: 0 * t


@dataclass
class Moving:
    """The true motion at given times."""

    t: np.ndarray
    q: np.ndarray
    w: np.ndarray
    a: np.ndarray

    @property
    def x(self):
        return np.stack(
            [
                L1 * np.cos(self.q[:, 0]) + L2 * np.sin(self.q[:, 1]),
                L1 * np.sin(self.q[:, 0]) - L2 * np.cos(self.q[:, 1]),
            ],
            1,
        )

    @property
    def complex_rates(self):
        """x' and x'' as complex numbers: x + iy = l1 e^{i q1} - i l2 e^{i q2}."""
        e1, e2 = L1 * np.exp(1j * self.q[:, 0]), -1j * L2 * np.exp(1j * self.q[:, 1])
        v = 1j * self.w[:, 0] * e1 + 1j * self.w[:, 1] * e2
        acc = (1j * self.a[:, 0] - self.w[:, 0] ** 2) * e1 + (1j * self.a[:, 1] - self.w[:, 1] ** 2) * e2
        return v, acc

    @property
    def v(self):
        v, _ = self.complex_rates
        return np.stack([v.real, v.imag], 1)

    @property
    def acc(self):
        _, acc = self.complex_rates
        return np.stack([acc.real, acc.imag], 1)

    def lever(self, force):
        """Joint torques of a force at the tip: Re(conj(dz/dq_j) f)."""
        f = force[:, 0] + 1j * force[:, 1]
        e1, e2 = 1j * L1 * np.exp(1j * self.q[:, 0]), L2 * np.exp(1j * self.q[:, 1])
        return np.stack([(np.conj(e1) * f).real, (np.conj(e2) * f).real], 1)


def motion(rng, centre, span_deg, duration):
    frequency = 2 * np.pi * (np.arange(1, 11) - rng.uniform(0.0, 0.6, (2, 10))) / 5
    phase = rng.uniform(0, 2 * np.pi, (2, 10))
    t = np.arange(0, duration, 0.01)
    gain = np.deg2rad(span_deg) / np.ptp(np.sin(frequency[:, :, None] * t + phase[:, :, None]).sum(1), axis=1)

    def at(t):
        u = frequency[:, :, None] * t + phase[:, :, None]
        w = frequency[:, :, None]
        q = centre[:, None] + gain[:, None] * np.sin(u).sum(1)
        return Moving(
            t, q.T, (gain[:, None] * (w * np.cos(u)).sum(1)).T, (-gain[:, None] * (w**2 * np.sin(u)).sum(1)).T
        )

    return at


def noise(rng, kind, shape):
    white = rng.normal(size=shape)
    if kind == "ar":
        out = lfilter([1.0], [1.0, -0.95], white, axis=0)
    elif kind == "1/f":
        spectrum = np.fft.rfft(white, axis=0)
        f = np.maximum(np.arange(len(spectrum)), 1)[:, None]
        out = np.fft.irfft(spectrum / np.sqrt(f), shape[0], axis=0)
    elif kind == "t":
        out = rng.standard_t(3, size=shape)
    elif kind == "heteroscedastic":
        out = white * np.exp(np.cumsum(rng.normal(0, 0.005, shape), axis=0))
    else:
        out = white
    return out / out.std()


def build(world: World) -> Study:
    rng = np.random.default_rng(world.seed)
    alpha = np.array([0.06929, 0.04217, 0.04416, 0.06510, 0.07389]) * rng.uniform(0.8, 1.25, 5)
    setup = Setup(
        robot=RobotSetup("planar-2r-absolute", (L1, L2)),
        encoder=EncoderSetup((400_000, 400_000), (0.0, 0.0), (1, 1)),
        accelerometer=AccelerometerSetup(
            "ADXL203", 3.3, 65536, (1.65, 1.65), (0.62, 0.62), "link2", rng.uniform(-1, 1)
        ),
    )
    if not world.device:
        setup = replace(setup, accelerometer=None)
    loads = []
    for _ in range(world.loaded):
        k = rng.uniform(150, 500, 2)
        s = rng.uniform(-0.2, 0.2) * k.min()
        loads.append((rng.uniform(0.5, 1.6), np.array([[k[0], s], [s, k[1]]]), None))
    trials = []
    common = np.zeros(2)
    made: dict[bool, Law] = {}
    for index in range(world.free + world.loaded):
        loaded = index >= world.free
        number = index - world.free
        centre = np.array([np.pi / 4, np.pi / 4]) + (rng.uniform(-0.15, 0.15, 2) if loaded else 0)
        if loaded and world.same_load and number:
            centre = common
        common = centre
        at = motion(rng, centre, 10.0 if loaded else 40.0, world.duration)
        at = made.setdefault(loaded, at) if world.repeat else at
        load = None
        if loaded:
            m, K, _ = loads[0 if world.same_load else number]
            x0 = Moving(np.zeros(1), centre[None], np.zeros((1, 2)), np.zeros((1, 2))).x[0]
            load = (m, K, x0)
        name = f"spring_{'A' if world.same_load else 'AB'[number % 2] + str(number // 2)}_{number + 1:02d}"
        trials.append(
            record(world, rng, setup, alpha, at, load, name if loaded else f"free_{index + 1:02d}", index)
        )
    return Study(f"study {world.seed}", setup, tuple(sorted(trials, key=lambda trial: trial.name)))


def inverse_dynamics(world, rng, alpha, m: Moving, load):
    s, c = np.sin(m.q[:, 0] - m.q[:, 1]), np.cos(m.q[:, 0] - m.q[:, 1])
    t1 = alpha[0] * m.a[:, 0] - 0.5 * alpha[1] * (s * m.a[:, 1] - c * m.w[:, 1] ** 2) + alpha[3] * m.w[:, 0]
    t2 = alpha[2] * m.a[:, 1] - 0.5 * alpha[1] * (s * m.a[:, 0] + c * m.w[:, 0] ** 2) + alpha[4] * m.w[:, 1]
    tau = np.stack([t1, t2], 1)
    gx, gy = world.gravity
    s1, s2 = world.moments
    # Potential -m g . r: first link along (cos q1, sin q1), second along (sin q2, -cos q2).
    tau[:, 0] -= s1 * (-gx * np.sin(m.q[:, 0]) + gy * np.cos(m.q[:, 0]))
    tau[:, 1] -= s2 * (gx * np.cos(m.q[:, 1]) + gy * np.sin(m.q[:, 1]))
    for hook in world.torque:
        tau = tau + hook(m, load)
    for hook in world.tip_force:
        tau = tau + m.lever(hook(m, load))
    force = np.zeros_like(tau)
    if load is not None:
        mass, K, x0 = load
        pull = mass * m.acc + (m.x - x0) @ K.T - mass * np.array(world.gravity)
        for hook in world.load_force:
            pull = pull + hook(m, load)
        tau = tau + m.lever(pull)
        force = -pull
    return tau, force


def record(world, rng, setup, alpha, at, load, name, index):
    offset, rate = 17.3 + 60 * index, 1 + 60e-6
    t_robot = np.arange(0.05, world.duration, 1e-3)
    # The log's stamp is late by what the clock errs; what it says happened at the true time.
    true = t_robot - world.clock_error(t_robot)
    there = at(true)
    tau, _ = inverse_dynamics(world, rng, alpha, at(true - world.delay), load)
    _, force = inverse_dynamics(world, rng, alpha, there, load)
    tau = tau / np.array(world.gain)
    tau = tau + world.torque_noise * noise(rng, world.noise_kind, tau.shape)
    force = force + rng.normal(0, 0.03, force.shape)
    read = lambda q: np.round((q + world.encoder_error(q)) / COUNT) * COUNT  # noqa: E731
    log = RobotLog(
        t=t_robot,
        theta=read(there.q),
        tau=np.round(tau, 7),
        force=force if world.force_sensor else None,
    )
    device = None
    if world.device:
        t_us = np.arange(np.ceil((offset + 0.4) * 1e6), (offset + world.duration) * 1e6, 1000).astype(
            np.uint64
        )
        t = (t_us * 1e-6 - offset) / rate
        now = at(t)
        felt = at(t - world.accel_delay)
        f = felt.acc - np.array(world.gravity)
        # Sensor off the end point by a lever along its axes, which turn with link 2.
        mount = setup.accelerometer.mount_angle_rad
        lever = np.array(world.accel_lever)
        nominal = np.exp(-1j * (felt.q[:, 1] + mount))
        z = (f[:, 0] + 1j * f[:, 1]) * nominal
        z = z + (1j * felt.a[:, 1] - felt.w[:, 1] ** 2) * (lever[0] + 1j * lever[1])
        z = z * np.exp(-1j * world.accel_angle)
        axes = np.stack([z.real, z.imag], 1)
        axes = axes + np.array(world.accel_cross) * axes[:, ::-1]
        axes = axes * np.array(world.accel_gain) + np.array(world.accel_bias)
        axes = axes + rng.normal(0, 0.030, axes.shape)
        codes = np.round((1.65 + axes / G * 0.62) / 3.3 * 65536).astype(np.uint16)
        counts = np.round(read(now.q) / COUNT).astype(np.int32)
        device = DeviceSamples(
            t_us=t_us,
            seq=np.arange(len(t_us), dtype=np.uint32),
            ax=codes[:, 0],
            ay=codes[:, 1],
            enc1=counts[:, 0],
            enc2=counts[:, 1],
            flags=np.zeros(len(t_us), dtype=np.uint8),
        )
    return Trial(name, "free" if load is None else "mass-spring", name.rsplit("_", 1)[0], log, device)


@pytest.fixture
def make():
    """`make(seed, hook=...)`: a study with that truth."""
    return lambda seed, **truth: build(World(seed, **truth))
