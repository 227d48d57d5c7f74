"""Effects of the drives and of the torque log that have no name in the catalogue."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from ..mechanics import Array
from ..motion import RATE, Motion
from .base import Effect


class MotorsWarm(Effect):
    """The torque constant sags as the motors warm through the session."""

    near, start, most = ("actuator.gain",), 0.05, 0.5

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.7)
        self.tau = float(rng.uniform(60, 300))

    def drive(self, m: Motion, tau: Array) -> Array:
        warm = 1 - np.exp(-np.clip(m.since + m.t, 0, None) / self.tau)[:, None]
        return np.asarray(tau / (1 - self.amount * self.mask * warm))


class DriveSaturates(Effect):
    """Iron saturates: the true torque falls behind the logged one at large currents."""

    start = 0.02

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau + self.amount * self.mask * tau**3


class InverterDeadTime(Effect):
    """The bridge's dead time eats a little torque against the current's sign."""

    start = 0.02

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.width = float(rng.uniform(0.02, 0.1))

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau + self.amount * self.mask * np.tanh(tau / self.width)


class UnequalDrive(Effect):
    """The amplifier's gain for positive currents is not that for negative ones."""

    near, start, most = ("actuator.gain",), 0.04, 0.5

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau * (1 + self.amount * self.mask * np.where(tau > 0, 0.5, -0.5))


class CommutationRipple(Effect):
    """Torque ripple in proportion to the torque: the gain waves with the motor's angle."""

    start, most = 0.05, 0.6

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.cycles, self.phase = float(rng.uniform(12, 50)), float(rng.uniform(0, 2 * np.pi))

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau / (1 + self.amount * self.mask * np.sin(self.cycles * m.theta + self.phase))


class CrossedDrives(Effect):
    """Each drive's current sensor hears the other's cable."""

    start, most = 0.02, 0.3

    def draw(self, rng: Generator) -> None:
        self.where, self.cross = ["joint1", "joint2"], rng.choice([-1, 1], 2) * rng.uniform(0.4, 1, 2)

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau + self.amount * self.cross * tau[:, ::-1]


class CoarseCommands(Effect):
    """The converter behind the drive has coarse steps; the log holds what was asked for."""

    start = 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.6)

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau + self.mask * (self.amount * np.round(tau / self.amount) - tau)


class BoxcarLog(Effect):
    """The logger averages the torque over a long window that is centred where it says."""

    start, most = 0.05, 0.4

    def draw(self, rng: Generator) -> None:
        self.where = ["joint1", "joint2"]

    def drive(self, m: Motion, tau: Array) -> Array:
        half = 0.5 * self.amount
        total = np.cumsum(tau, axis=0) / RATE - 0.5 * tau / RATE
        first, last = (np.clip(m.t + end, m.t[0], m.t[-1]) for end in (-half, half))
        sums = [np.interp(last, m.t, c) - np.interp(first, m.t, c) for c in total.T]
        return np.column_stack(sums) / (last - first)[:, None]


ALL: list[type[Effect]] = [
    MotorsWarm, DriveSaturates, InverterDeadTime, UnequalDrive, CommutationRipple,
    CrossedDrives, CoarseCommands, BoxcarLog,
]  # fmt: skip
