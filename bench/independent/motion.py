"""What the joints are told to do, what a PD controller makes of it, and the state along the way.

A controller with gains kp, kd that asks for a path r gets the path θ on which

    kp (r - θ) + kd (r' - θ') = τ(θ, θ', θ'')

with τ from the inverse dynamics, load and effects included. One step of the fixed-point iteration from
θ = r gives the path used here; whatever it leaves over is a small change of r, which no log holds, so the
record stays exact: θ and its derivatives belong together to rounding, and τ belongs to them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator
from scipy.signal import butter, lfilter, sosfiltfilt

from .laboratory import Laboratory, Plan
from .mechanics import Array, Load, Robot

RATE = 1000.0  # of the grid on which the physics is worked out, Hz
PAD = 1.5  # s before and after the record, so that filters and delays find a past and a future
HARDEST = 7.0  # acceleration that each joint alone may give the tip, m/s²; the accelerometer ends at 25
TOP = 14.0  # nothing in the joints' motion above this, Hz


@dataclass(frozen=True)
class Motion:
    """One trial on the fine grid; ``t`` is 0 where its record starts, ``since`` the study's time there."""

    plan: Plan
    index: int
    since: float
    laboratory: Laboratory
    t: Array
    theta: Array
    omega: Array
    accel: Array
    x: Array = field(init=False)
    v: Array = field(init=False)
    a: Array = field(init=False)

    def __post_init__(self) -> None:
        velocity, acceleration = self.robot.tip_rates(self.theta, self.omega, self.accel)
        object.__setattr__(self, "x", self.robot.tip(self.theta))
        object.__setattr__(self, "v", velocity)
        object.__setattr__(self, "a", acceleration)

    @property
    def robot(self) -> Robot:
        return self.laboratory.robot

    @property
    def load(self) -> Load | None:
        return self.plan.load

    @property
    def loaded(self) -> bool:
        return self.plan.load is not None

    @property
    def share(self) -> Array:
        """Time from 0 to 1 through the record, held beyond its ends."""
        return np.clip(self.t / self.plan.duration, 0, 1)

    def rng(self, *key: int) -> Generator:
        """Chance that belongs to this trial and to ``key``, the same whenever it is asked for."""
        return np.random.default_rng([self.laboratory.seed, 9, self.index, *key])

    def turned(self, frame: str, angle: float, vector: Array, back: bool = False) -> Array:
        """A base-frame vector along axes fixed to ``frame`` ("link2" or otherwise the base) turned by ``angle``."""
        way = angle + (self.theta[:, 1] if frame == "link2" else 0.0)
        c, s = np.cos(way), np.sin(way) * (-1 if back else 1)
        return np.column_stack([c * vector[:, 0] + s * vector[:, 1], -s * vector[:, 0] + c * vector[:, 1]])


def derivative(values: Array, rate: float = RATE) -> Array:
    """Sixth-order central difference; the three rows at each end repeat their neighbours."""
    out = np.empty_like(values)
    out[3:-3] = (
        45 * (values[4:-2] - values[2:-4]) - 9 * (values[5:-1] - values[1:-5]) + values[6:] - values[:-6]
    ) * (rate / 60)
    out[:3], out[-3:] = out[3], out[-4]
    return out


def low_pass(values: Array, cutoff: float, rate: float = RATE, order: int = 4) -> Array:
    """Zero phase Butterworth."""
    return sosfiltfilt(butter(order, cutoff, fs=rate, output="sos"), values, axis=0)


def _multisine(rng: Generator, t: Array) -> Array:
    count = int(rng.integers(6, 13))
    f = np.sort(rng.uniform(0.1, rng.uniform(1.6, 2.6), count))
    phases = rng.uniform(0, 2 * np.pi, count)
    return np.asarray(np.sin(2 * np.pi * np.outer(t, f) + phases).sum(1))


def _moves(rng: Generator, t: Array) -> Array:
    """Random places, minimum-jerk moves between them, short rests."""
    out, at, when = np.zeros_like(t), 0.0, t[0]
    while when < t[-1]:
        target, lasts, rest = rng.uniform(-1, 1), rng.uniform(0.35, 0.9), rng.uniform(0.05, 0.5)
        s = np.clip((t - when) / lasts, 0, 1)
        out += (target - at) * s**3 * (10 - 15 * s + 6 * s**2)
        at, when = target, when + lasts + rest
    return out


def _chirp(rng: Generator, t: Array) -> Array:
    """Up and down between 0.15 and 2.5 Hz, beside a slow wave."""
    f0, f1 = rng.uniform(0.1, 0.3), rng.uniform(1.8, 2.6)
    sweep = 0.5 - 0.5 * np.cos(2 * np.pi * (t - t[0]) * rng.integers(1, 4) / (t[-1] - t[0]))
    phase = 2 * np.pi * np.cumsum(f0 * (f1 / f0) ** sweep) / RATE + rng.uniform(0, 2 * np.pi)
    size = (f0 / (f0 * (f1 / f0) ** sweep)) ** 0.5
    slow = np.sin(2 * np.pi * rng.uniform(0.08, 0.3) * t + rng.uniform(0, 6.3))
    return np.asarray(size * np.sin(phase) + 0.7 * slow)


WAYS = {"multisine": _multisine, "moves": _moves, "chirp": _chirp}


def reference(laboratory: Laboratory, plan: Plan, index: int) -> tuple[Array, Array]:
    """Times and the path asked for, (n,) and (n, 2)."""
    rng = np.random.default_rng([laboratory.seed, 3, index])
    t = np.arange(-PAD, plan.duration + PAD, 1 / RATE)
    path = np.empty((t.size, 2))
    for joint in range(2):
        style = str(rng.choice(sorted(WAYS))) if plan.style == "mixed" else plan.style
        wave = WAYS[style](rng, t)
        wave = wave - 0.5 * (wave.max() + wave.min())
        swing = low_pass(plan.reach * wave / np.abs(wave).max(), TOP)
        hardest = laboratory.robot.lengths[joint] * np.abs(derivative(derivative(swing))).max()
        path[:, joint] = laboratory.centre[joint] + swing * min(1.0, HARDEST / hardest)
    return t, path


def moving(laboratory: Laboratory, plan: Plan, index: int, since: float, t: Array, path: Array) -> Motion:
    omega = derivative(path)
    return Motion(plan, index, since, laboratory, t, path, omega, derivative(omega))


def controlled(wanted: Motion, torque: Callable[[Motion], Array]) -> Motion:
    """The motion that the controller makes of the wanted one; ``torque`` is what the motors must deliver."""
    lab = wanted.laboratory
    tau = torque(wanted)
    lag = np.empty_like(tau)
    heavy = 1.0 if wanted.load is None else 1.0 + 2.0 * wanted.load.moved.trace() * lab.robot.lengths[0] ** 2
    for joint in range(2):
        inertia = lab.robot.alpha[2 * joint] * heavy
        kp, kd = inertia * lab.stiffness**2, 2 * lab.damping * inertia * lab.stiffness
        fade = np.exp(-kp / kd / RATE)
        lag[:, joint] = (
            lfilter([(1 - fade) / kp], [1, -fade], tau[:, joint] - tau[0, joint]) + tau[0, joint] / kp
        )
    path = low_pass(wanted.theta - lag, TOP)
    return moving(lab, wanted.plan, wanted.index, wanted.since, wanted.t, path)
