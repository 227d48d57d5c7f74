"""More effects of accelerometer, encoders, clock and force sensor without a name in the catalogue."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from ..mechanics import Array
from ..motion import Motion, low_pass
from .base import Effect, first_order, play, shifted, slip


def both(values: Array, width: float) -> Array:
    """Dahl's slip of each column."""
    return np.column_stack([slip(values[:, j], width) for j in range(values.shape[1])])


def turned_by(f: Array, angle: Array) -> Array:
    """Readings of a sensor turned by an angle that changes, (n,)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack([c * f[:, 0] + s * f[:, 1], -s * f[:, 0] + c * f[:, 1]])


class _Axes(Effect):
    """Acts on one or both axes of a sensor."""

    def draw(self, rng: Generator) -> None:
        self.pick_axes(rng)
        self.places, self.where = self.where, ["sensor"]
        self.shape(rng)

    def shape(self, rng: Generator) -> None:
        """What is random beside the axes."""


class AccelRemembers(_Axes):
    """The accelerometer's zero hangs behind: remanence that follows the last large acceleration."""

    start, most = 0.05, 2.0

    def shape(self, rng: Generator) -> None:
        self.width = float(rng.uniform(0.5, 2))

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return f - self.amount * np.abs(self.shares) * both(f, self.width)


class AccelCrossover(_Axes):
    """The amplifier has a dead zone about its middle: small accelerations are lost, large ones lessened."""

    near, start, most = ("accel.scale",), 0.1, 1.5

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return np.asarray(f - np.abs(self.shares) * np.clip(f, -self.amount, self.amount))


class AccelRectifies(_Axes):
    """Shaking is rectified: the zero follows the mean square of the acceleration over a second or so."""

    near, start = ("accel.bias",), 0.02

    def shape(self, rng: Generator) -> None:
        self.lag = float(rng.uniform(0.3, 2))

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        power = (f**2).sum(1, keepdims=True)
        return f + self.amount * self.shares * first_order(power, self.lag)


class AccelNearMagnet(_Axes):
    """The sensor's zero moves where it comes near a magnet in the table."""

    near, start, most = ("accel.bias",), 0.2, 4.0

    def shape(self, rng: Generator) -> None:
        self.at, self.width = self.lab.home + rng.normal(0, 0.02, 2), float(rng.uniform(0.012, 0.03))

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        away = ((m.x - self.at) ** 2).sum(1, keepdims=True)
        return np.asarray(f + self.amount * self.shares * np.exp(-0.5 * away / self.width**2))


class SensorFlips(Effect):
    """One screw of the sensor is loose: it rests against one side or the other, as the last push left it."""

    near, start, most = ("accel.misalignment",), 0.02, 0.3

    def draw(self, rng: Generator) -> None:
        self.where, self.hold = ["sensor"], float(rng.uniform(0.5, 2))

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        side = slip(low_pass(f, 20.0)[:, 1], self.hold, 0.5)
        return turned_by(f, self.amount * side)


class AccelSlidesInTime(Effect):
    """The sensor converts by its own clock: its newest value is old by a time that beats with the module's."""

    near, start, most = ("accel.delay",), 0.01, 0.08

    def draw(self, rng: Generator) -> None:
        self.where, self.every = ["sensor"], float(rng.uniform(0.3, 4))

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return shifted(f, self.amount * np.mod((m.since + m.t) / self.every, 1.0), m.t)


class AccelHearsSpeed(_Axes):
    """A wire loop in the motors' field: the accelerometer's reading has a part of the joints' speeds."""

    near, start = ("accel.delay",), 0.05

    def shape(self, rng: Generator) -> None:
        self.mix = rng.normal(0, 1, (2, 2))

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return f + self.amount * np.abs(self.shares) * (m.omega @ self.mix.T)


class TapeSeam(Effect):
    """The encoder's tape is glued in two pieces: beyond the seam its scale is another."""

    near, start, most = ("encoder.scale",), 0.02, 0.3

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.side = float(rng.choice([-1, 1]))
        self.at = np.array(self.lab.centre) + np.radians(rng.uniform(-2.5, 2.5, 2))

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        return np.asarray(theta + self.amount * self.side * self.mask * np.clip(theta - self.at, 0, None))


class PolesUneven(Effect):
    """A magnetic encoder with two pairs of poles, one weak: an error with four waves a turn and with eight."""

    near, start, most = ("encoder.eccentricity", "encoder.scale", "encoder.zero"), 0.003, 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.2)
        self.phase = rng.uniform(0, 2 * np.pi, 2)

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        wave = np.sin(4 * theta + self.phase) + 0.4 * np.sin(8 * theta - self.phase)
        return theta + self.amount * self.shares * wave


class AnglesLate(Effect):
    """A filter in the encoders' counter: all angles are late, in both logs, torque and acceleration are not."""

    near, start, most = ("accel.delay", "actuator.delay", "force.delay"), 0.003, 0.05

    def draw(self, rng: Generator) -> None:
        self.where = ["joint1", "joint2"]

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        return shifted(theta, self.amount, m.t)


class CouplingSlack(Effect):
    """The encoder's coupling has slack: its disc is dragged along, half a play behind in either direction."""

    start, most = 1e-3, 0.02

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        # rounded off by the disc's own friction: a play with a soft bottom
        behind = [play(theta[:, j], self.amount) - play(theta[:, j], 0.0) for j in range(2)]
        return theta + self.mask * low_pass(np.column_stack(behind), 25.0)


class CouplingCreepsBack(Effect):
    """The encoder's rubber coupling gives way to each change of torque and creeps back within tenths of a second."""

    near, start, most = ("elastic.transmission",), 1e-3, 0.03

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.lag = float(rng.uniform(0.05, 0.3))

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        smooth = low_pass(tau, 15.0)
        return theta + self.amount * self.mask * (smooth - first_order(smooth, self.lag))


class ClockResyncs(Effect):
    """The robot's clock runs fast and is set back by the network every few seconds: a saw in its time."""

    near, start, most = ("clock.drift",), 0.005, 0.06

    def draw(self, rng: Generator) -> None:
        self.where, self.every = ["sensor"], float(rng.uniform(3, 8))

    def clock(self, m: Motion, t: Array) -> Array:
        # set back slowly enough that the robot's time never stands still
        saw = np.mod((m.since + t) / self.every, 1.0)
        back = np.clip((1 - saw) * self.every / max(0.2, 4 * self.amount), 0, 1)
        return self.amount * (saw * back - 0.5)


class _Force(_Axes):
    needs = frozenset({"force_sensor"})


class ForceRemembers(_Force):
    """The force sensor's glue slips a little: its reading has a loop, wide at small forces."""

    near, start = ("force.scale",), 0.1

    def shape(self, rng: Generator) -> None:
        self.width = float(rng.uniform(1, 6))

    def sensed(self, m: Motion, force: Array) -> Array:
        return force - self.amount * np.abs(self.shares) * both(force, self.width)


class ForceGainWarms(_Force):
    """The force sensor's gain creeps as it warms through the session."""

    near, start, most = ("force.scale",), 0.05, 0.6

    def shape(self, rng: Generator) -> None:
        self.lag = float(rng.uniform(50, 250))

    def sensed(self, m: Motion, force: Array) -> Array:
        warm = (1 - np.exp(-np.clip(m.since + m.t, 0, None) / self.lag))[:, None]
        return np.asarray(force * (1 + self.amount * self.shares * warm))


class ForceZeroYields(_Force):
    """Each force beyond what was there before moves the zero for good: it climbs in steps and never comes back."""

    near, start = ("force.bias",), 0.1

    def sensed(self, m: Motion, force: Array) -> Array:
        size = np.linalg.norm(force, axis=1)
        typical = max(float(np.sqrt(np.mean(size**2))), 1e-6)
        record = np.maximum.accumulate(np.clip(size, 0.5 * typical, None)) / typical
        return force + self.amount * self.shares * (record - 0.5)[:, None]


class ForceSlow(_Force):
    """A first-order filter of the amplifier, on one axis or both and not with the same corner."""

    near, start, most = ("force.delay",), 0.005, 0.1

    def sensed(self, m: Motion, force: Array) -> Array:
        sizes = np.abs(self.shares)
        slow = [
            first_order(force[:, [j]], self.amount * sizes[j])[:, 0] if sizes[j] else force[:, j]
            for j in range(2)
        ]
        return np.column_stack(slow)


class ForceHearsMotors(_Force):
    """The motors' cables run beside the force sensor's: it hears their currents."""

    start = 0.1

    def shape(self, rng: Generator) -> None:
        self.mix = rng.normal(0, 1, (2, 2))

    def sensed(self, m: Motion, force: Array) -> Array:
        tau = m.robot.inverse(m.theta, m.omega, m.accel) - m.robot.to_joints(m.theta, force)
        return force + self.amount * np.abs(self.shares) * (tau @ self.mix.T)


class ForceProduct(_Force):
    """Each axis of the force sensor is made stiffer or softer by the other: a product of both forces."""

    start = 0.005

    def sensed(self, m: Motion, force: Array) -> Array:
        return force + self.amount * self.shares * force[:, [0]] * force[:, [1]]


ALL: list[type[Effect]] = [
    AccelRemembers, AccelCrossover, AccelRectifies, AccelNearMagnet, SensorFlips, AccelSlidesInTime,
    AccelHearsSpeed, TapeSeam, PolesUneven, AnglesLate, CouplingSlack, CouplingCreepsBack, ClockResyncs,
    ForceRemembers, ForceGainWarms, ForceZeroYields, ForceSlow, ForceHearsMotors, ForceProduct,
]  # fmt: skip
