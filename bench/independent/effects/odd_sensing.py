"""Effects of the instruments that have no name in the catalogue."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from ..mechanics import Array
from ..motion import RATE, Motion
from .base import Effect, first_order
from .odd_machine import resonator


class _Accel(Effect):
    def draw(self, rng: Generator) -> None:
        self.pick_axes(rng)
        self.places, self.where = self.where, ["sensor"]
        self.shape(rng)

    def shape(self, rng: Generator) -> None:
        """What is random beside the axes."""


class BracketRings(_Accel):
    """The accelerometer's bracket resonates; ``amount`` is the share of the ringing that is felt."""

    near, start, most = ("accel.delay", "accel.scale"), 0.3, 1.0

    def shape(self, rng: Generator) -> None:
        self.w, self.zeta = 2 * np.pi * float(rng.uniform(5, 14)), float(rng.uniform(0.02, 0.08))

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return f + self.amount * np.abs(self.shares) * (resonator(f, self.w, self.zeta) - f)


class TorqueCrosstalk(_Accel):
    """Motor currents induce a voltage in the accelerometer's wires."""

    start = 0.05

    def shape(self, rng: Generator) -> None:
        self.mix = rng.normal(0, 1, (2, 2))

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return f + self.amount * tau @ self.mix.T


class InterferenceBursts(_Accel):
    """Bursts of interference, a tone of 2 to 8 Hz within each, a few tenths of a second long."""

    start = 0.3

    def shape(self, rng: Generator) -> None:
        self.f, self.every = float(rng.uniform(2, 8)), float(rng.uniform(1.5, 5))

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        rng, gate = m.rng(self.salt), np.zeros_like(m.t)
        when = float(m.t[0])
        while when < m.t[-1]:
            when += rng.exponential(self.every)
            gate += np.exp(-0.5 * ((m.t - when) / rng.uniform(0.08, 0.3)) ** 2)
        return f + self.amount * self.shares * (gate * np.sin(2 * np.pi * self.f * m.t))[:, None]


class ZeroGDrifts(_Accel):
    """The accelerometer's zero creeps as it warms through the session."""

    near, start = ("accel.bias",), 0.1

    def shape(self, rng: Generator) -> None:
        self.tau = float(rng.uniform(40, 200))

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return np.asarray(
            f + self.amount * self.shares * (1 - np.exp(-np.clip(m.since + m.t, 0, None) / self.tau))[:, None]
        )


class GainDrifts(_Accel):
    """The accelerometer's gain creeps as it warms through the session."""

    near, start, most = ("accel.scale",), 0.05, 0.6

    def shape(self, rng: Generator) -> None:
        self.tau = float(rng.uniform(40, 200))

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        warm = (1 - np.exp(-np.clip(m.since + m.t, 0, None) / self.tau))[:, None]
        return np.asarray(f * (1 + self.amount * self.shares * warm))


class SensorBends(_Accel):
    """The accelerometer is not linear: a square and a cube."""

    start = 0.01

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return f + self.amount * self.shares * (f**2 + 0.2 * f**3)


class SensorSlow(_Accel):
    """A capacitor too large: the accelerometer is a low-pass of first order."""

    near, start, most = ("accel.delay",), 0.005, 0.1

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return first_order(f, self.amount)


class SensorRecovers(_Accel):
    """A coupling capacitor: slow signals fade with a corner below 0.3 Hz."""

    start, most = 0.2, 2.0

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        # charged to its mean long ago
        slow = first_order(np.concatenate([np.zeros((1, 2)), f]), 1 / self.amount)[1:]
        return f - slow


class SensorWobbles(_Accel):
    """The sensor's glue is soft: it turns by a small angle with the force along its first axis."""

    start, most = 0.005, 0.06

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        angle = self.amount * f[:, 0]
        c, s = np.cos(angle), np.sin(angle)
        return np.column_stack([c * f[:, 0] + s * f[:, 1], -s * f[:, 0] + c * f[:, 1]])


class CountsLost(Effect):
    """The counter loses counts at fast moments: the angle steps away a few times in a trial."""

    near, start, most = ("encoder.zero",), 0.003, 0.1

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        rng = m.rng(self.salt)
        times = np.sort(rng.uniform(0, m.plan.duration, 3))
        return np.asarray(
            theta + self.amount * self.mask * np.searchsorted(times, m.t)[:, None] * rng.choice([-1, 1])
        )


class TorqueHeldOver(Effect):
    """The drive's packets get lost and the logger repeats the last torque; ``amount`` is the longest hold in s."""

    start, most = 0.05, 1.0

    def draw(self, rng: Generator) -> None:
        self.where, self.every = ["joint1", "joint2"], float(rng.uniform(0.5, 2))

    def drive(self, m: Motion, tau: Array) -> Array:
        rng, source, when = m.rng(self.salt), np.arange(m.t.size), float(m.t[0])
        while when < m.t[-1]:
            when += rng.exponential(self.every)
            first, last = np.searchsorted(m.t, [when, when + self.amount * rng.uniform(0.3, 1)])
            source[first:last] = min(first, m.t.size - 1)
        return tau[source]


class ClockJumps(Effect):
    """The robot's clock is set once in each trial: its time steps."""

    near, start, most = ("clock.drift",), 0.005, 0.1

    def draw(self, rng: Generator) -> None:
        self.where = ["sensor"]

    def clock(self, m: Motion, t: Array) -> Array:
        at = m.rng(self.salt).uniform(0.3, 0.7) * m.plan.duration
        return np.where(t > at, self.amount, 0.0)


class _Force(Effect):
    needs = frozenset({"force_sensor"})

    def draw(self, rng: Generator) -> None:
        self.pick_axes(rng)
        self.places, self.where = self.where, ["sensor"]


class ForceCreeps(_Force):
    """The force sensor's glue creeps: a slow share of the force comes in with a time constant of seconds."""

    near, start, most = ("force.scale",), 0.05, 0.6

    def draw(self, rng: Generator) -> None:
        super().draw(rng)
        self.tau = float(rng.uniform(0.5, 5))

    def sensed(self, m: Motion, force: Array) -> Array:
        return force + self.amount * np.abs(self.shares) * first_order(force, self.tau)


class ForceWarms(_Force):
    """The force sensor's zero warms through the session and is never set again."""

    near, start = ("force.bias",), 0.3

    def sensed(self, m: Motion, force: Array) -> Array:
        return np.asarray(
            force + self.amount * self.shares * (1 - np.exp(-np.clip(m.since + m.t, 0, None) / 80.0))[:, None]
        )


class ForceHearsTurning(_Force):
    """The force sensor's axes hear the moment that turning the handle takes."""

    start = 0.02

    def sensed(self, m: Motion, force: Array) -> Array:
        return force + self.amount * self.shares * m.accel[:, 1:]


class ForceBends(_Force):
    """The force sensor is not linear: a square and a cube."""

    start = 0.002

    def sensed(self, m: Motion, force: Array) -> Array:
        return force + self.amount * self.shares * (force**2 + 0.05 * force**3)


class TorqueSensorHum(Effect):
    """A beat in the torque log: a line between 0.5 and 5 Hz whose phase knows nothing of the motion."""

    start = 0.02

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.f = float(rng.uniform(0.5, 5))

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau + self.amount * self.shares * np.sin(2 * np.pi * self.f * (m.since + m.t))[:, None]


class TorqueOffsetWalks(Effect):
    """The torque log's zero walks about by far more than its noise, some tenths of a hertz wide."""

    near, start = ("actuator.offset",), 0.02

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)

    def drive(self, m: Motion, tau: Array) -> Array:
        fade = np.exp(-2 * np.pi * 0.05 / RATE)
        walk = lfilter([1 - fade], [1, -fade], m.rng(self.salt).standard_normal(tau.shape), axis=0)
        return np.asarray(tau + self.amount * self.shares * walk / walk.std())


ALL: list[type[Effect]] = [
    BracketRings, TorqueCrosstalk, InterferenceBursts, ZeroGDrifts, GainDrifts, SensorBends, SensorSlow,
    SensorRecovers, SensorWobbles, CountsLost, TorqueHeldOver, ClockJumps, ForceCreeps, ForceWarms, ForceHearsTurning,
    ForceBends, TorqueSensorHum, TorqueOffsetWalks,
]  # fmt: skip
