"""More effects of the drives and of the torque log without a name in the catalogue."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from ..mechanics import Array
from ..motion import Motion, derivative, low_pass
from .base import Effect, first_order, play, shifted


def beyond(values: Array, edge: float) -> Array:
    """What is left of values outside of -edge to edge."""
    return values - np.clip(values, -edge, edge)


def slow(m: Motion, salt: int, lag: float) -> Array:
    """A slow random curve of unit root mean square, another in each trial; (n,)."""
    raw = m.rng(salt).standard_normal((m.t.size, 1))
    curve = first_order(first_order(raw, lag), lag)[:, 0]
    return np.asarray((curve - curve.mean()) / curve.std())


class SlewingDrive(Effect):
    """The drive follows slow commands at once and lags behind those that change faster than it can."""

    near, start, most = ("actuator.lag",), 0.01, 0.5

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.6)
        self.fastest = float(rng.uniform(1, 4))  # N m/s

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau + self.amount * self.mask * beyond(derivative(low_pass(tau, 60.0)), self.fastest)


class BusSags(Effect):
    """Both drives hang on one weak supply: what power either draws takes some torque from both."""

    near, start, most = ("actuator.gain",), 0.1, 3.0

    def draw(self, rng: Generator) -> None:
        self.where, self.lag = ["joint1", "joint2"], float(rng.uniform(0.03, 0.3))

    def drive(self, m: Motion, tau: Array) -> Array:
        drawn = np.clip(tau * m.omega, 0, None).sum(1, keepdims=True)
        return tau * (1 + self.amount * first_order(drawn, self.lag))


class FieldWeakens(Effect):
    """Beyond a base speed the back voltage eats into the torque, in proportion to the excess."""

    near, start = ("friction.quadratic",), 0.1

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.base = float(rng.uniform(0.15, 0.4))

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau + self.amount * self.shares * beyond(m.omega, self.base)


class CoilHeats(Effect):
    """The winding heats with the square of the torque and cools within seconds; hot, it gives less."""

    near, start = ("actuator.gain",), 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.lag = float(rng.uniform(2, 12))

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau * (1 + self.amount * self.mask * first_order(tau**2, self.lag))


class EddyTail(Effect):
    """Eddy currents in solid iron: a share of each change of torque arrives a tenth of a second late."""

    near, start, most = ("actuator.lag", "actuator.gain"), 0.03, 0.5

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.5)
        self.lag = float(rng.uniform(0.08, 0.4))

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau + self.amount * self.mask * (tau - first_order(tau, self.lag))


class LatencyWanders(Effect):
    """The torque's way through the network takes a time that wanders within a trial; the angles' does not."""

    near, start, most = ("actuator.delay", "clock.drift"), 0.005, 0.06

    def draw(self, rng: Generator) -> None:
        self.where, self.lag = ["joint1", "joint2"], float(rng.uniform(0.3, 2))

    def drive(self, m: Motion, tau: Array) -> Array:
        return shifted(tau, self.amount * np.clip(slow(m, self.salt, self.lag), -2.5, 2.5), m.t)


class BatchedTorque(Effect):
    """A buffer fills and is emptied: the torque is late by a time that rises like a saw and falls back."""

    near, start, most = ("actuator.delay",), 0.01, 0.1

    def draw(self, rng: Generator) -> None:
        self.where, self.every = ["joint1", "joint2"], float(rng.uniform(0.4, 2.5))

    def drive(self, m: Motion, tau: Array) -> Array:
        late = np.mod((m.since + m.t) / self.every, 1.0)
        return shifted(tau, self.amount * late, m.t)


class IntegratorLeftOut(Effect):
    """The log holds what the controller's fast parts ask for, without its integral of the way off the middle."""

    near, start = ("elastic.joint",), 0.2

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.leak = float(rng.uniform(0.6, 4))

    def drive(self, m: Motion, tau: Array) -> Array:
        off = m.theta - np.array(self.lab.centre)
        return tau - self.amount * self.shares * first_order(off, self.leak)


class LogOnChange(Effect):
    """The log follows the torque only where it has moved by more than a step: play in the value itself."""

    start = 0.03

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.6)

    def drive(self, m: Motion, tau: Array) -> Array:
        held = np.column_stack([play(tau[:, j], self.amount) for j in range(2)])
        return np.where(self.mask > 0, held, tau)


class SharedReference(Effect):
    """Both current sensors share one reference voltage, which the sum of their squares pulls down and off zero."""

    near, start = ("actuator.offset",), 0.01

    def draw(self, rng: Generator) -> None:
        self.where, self.mix = ["joint1", "joint2"], rng.choice([-1, 1], 2) * rng.uniform(0.4, 1, 2)

    def drive(self, m: Motion, tau: Array) -> Array:
        return np.asarray(tau + self.amount * self.mix * (tau**2).sum(1, keepdims=True))


class TorqueGlitches(Effect):
    """Now and then the current's reading falls by a share, ``amount``, for some hundredths of a second."""

    start, most = 0.3, 1.0

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.5)
        self.every, self.lasts = float(rng.uniform(0.8, 3)), float(rng.uniform(0.03, 0.12))

    def drive(self, m: Motion, tau: Array) -> Array:
        rng, gone, when = m.rng(self.salt), np.zeros_like(m.t), float(m.t[0])
        while when < m.t[-1]:
            when += rng.exponential(self.every)
            gone[(m.t >= when) & (m.t < when + self.lasts)] = 1.0
        return tau * (1 - self.amount * self.mask * gone[:, None])


ALL: list[type[Effect]] = [
    SlewingDrive, BusSags, FieldWeakens, CoilHeats, EddyTail, LatencyWanders, BatchedTorque, IntegratorLeftOut,
    LogOnChange, SharedReference, TorqueGlitches,
]  # fmt: skip
