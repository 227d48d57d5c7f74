"""Effects of the robot that have no name in the catalogue."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from ..mechanics import Array
from ..motion import RATE, Motion, derivative, low_pass
from .base import Effect, first_order, play, sign, slip, turn


class CableMaxwellSlip(Effect):
    """The cable bundle at the end point rubs: four spring-sliders in parallel along each direction."""

    start = 0.3

    def draw(self, rng: Generator) -> None:
        self.widths = np.geomspace(0.002, rng.uniform(0.02, 0.05), 4)
        self.axes, self.weak = turn(float(rng.uniform(0, np.pi))), float(rng.uniform(0.2, 0.8))

    def reaction(self, m: Motion, tau: Array) -> Array:
        along = m.x @ self.axes
        pull = np.column_stack(
            [sum((along[:, j] - play(along[:, j], w)) / w for w in self.widths) for j in range(2)]
        )
        return m.robot.to_joints(m.theta, self.amount / 4 * (pull * [1, self.weak]) @ self.axes.T)


class AirLineMemory(Effect):
    """An air line drags with memory: a spring in series with a damper at the end point."""

    start = 3.0

    def draw(self, rng: Generator) -> None:
        self.relax = float(rng.uniform(0.2, 1.5))
        axes = turn(float(rng.uniform(0, np.pi)))
        self.K = axes @ np.diag([1.0, rng.uniform(0.1, 1.0)]) @ axes.T

    def reaction(self, m: Motion, tau: Array) -> Array:
        stretch = m.x - first_order(m.x, self.relax)
        return m.robot.to_joints(m.theta, self.amount * stretch @ self.K.T)

    def parameters(self) -> dict[str, Any]:
        return {"stiffness": (self.amount * self.K).tolist(), "relaxation_s": self.relax}


class FractionalDamping(Effect):
    """Rubber in the joint: torque as a derivative of the angle of an order between 0.3 and 0.7."""

    start = 0.1

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.order = float(rng.uniform(0.3, 0.7))

    def reaction(self, m: Motion, tau: Array) -> Array:
        n = m.t.size
        f = np.fft.rfftfreq(2 * n, 1 / RATE)[:, None]
        swing = m.theta - m.theta.mean(0)
        both = np.concatenate([swing, swing[::-1]])  # no step where the ends meet
        return (
            self.amount
            * self.shares
            * np.fft.irfft(np.fft.rfft(both, axis=0) * (2j * np.pi * f) ** self.order, 2 * n, axis=0)[:n]
        )


class PowerLawFriction(Effect):
    """Shear-thinning grease: torque as the root of the speed."""

    near, start = ("friction.stribeck", "friction.coulomb"), 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.power = float(rng.uniform(0.3, 0.6))

    def reaction(self, m: Motion, tau: Array) -> Array:
        return self.amount * self.shares * sign(m.omega) * np.abs(m.omega) ** self.power


class CoupledDrag(Effect):
    """A belt runs from link to link: viscous drag on the difference of the two speeds."""

    start = 0.02

    def draw(self, rng: Generator) -> None:
        self.where = ["joint1", "joint2"]

    def reaction(self, m: Motion, tau: Array) -> Array:
        drag = self.amount * (m.omega[:, 0] - m.omega[:, 1])
        return np.column_stack([drag, -drag])


class GyroscopicMotor(Effect):
    """A flywheel out of the plane: each joint feels the other's speed, with opposite signs; no work is done."""

    start = 0.02

    def draw(self, rng: Generator) -> None:
        self.where = ["joint1", "joint2"]

    def reaction(self, m: Motion, tau: Array) -> Array:
        return self.amount * np.column_stack([m.omega[:, 1], -m.omega[:, 0]])


class CounterweightCrank(Effect):
    """A crank makes the first inertia vary with the angle, I11 + A cos(θ1 - φ), with the centrifugal term of it."""

    start = 0.02

    def draw(self, rng: Generator) -> None:
        self.where, self.phase = ["joint1"], self.lab.centre[0] + float(rng.choice([-1, 1]) * np.pi / 2)

    def reaction(self, m: Motion, tau: Array) -> Array:
        angle = m.theta[:, 0] - self.phase
        torque = np.cos(angle) * m.accel[:, 0] - 0.5 * np.sin(angle) * m.omega[:, 0] ** 2
        return self.amount * np.column_stack([torque, np.zeros_like(torque)])


class HangingPendulum(Effect):
    """Something dangles from the end point: a damped pendulum that the tip drives."""

    start = 0.05

    def draw(self, rng: Generator) -> None:
        self.f, self.zeta = float(rng.uniform(0.9, 2.2)), float(rng.uniform(0.03, 0.15))

    def reaction(self, m: Motion, tau: Array) -> Array:
        w = 2 * np.pi * self.f
        hung = resonator(m.x, w, self.zeta)
        force = self.amount * (w * w * (m.x - hung) + 2 * self.zeta * w * (m.v - derivative(hung)))
        return m.robot.to_joints(m.theta, force)


def resonator(x: Array, w: float, zeta: float) -> Array:
    """Position of a mass on a spring and damper whose foot moves as x; bilinear, in rest at first."""
    k = 2 * RATE
    b = [w * w + 2 * zeta * w * k, 2 * w * w, w * w - 2 * zeta * w * k]
    a = [k * k + 2 * zeta * w * k + w * w, 2 * (w * w - k * k), k * k - 2 * zeta * w * k + w * w]
    return np.asarray(lfilter(np.array(b) / a[0], np.array(a) / a[0], x - x[0], axis=0) + x[0])


class BearingSticks(Effect):
    """A dent in a bearing: dry friction at one place only."""

    near, start = ("friction.position", "friction.coulomb"), 0.1

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.at = np.array(self.lab.centre) + np.radians(rng.uniform(-3, 3, 2))
        self.width = float(rng.uniform(0.01, 0.03))

    def reaction(self, m: Motion, tau: Array) -> Array:
        bump = np.exp(-0.5 * ((m.theta - self.at) / self.width) ** 2)
        return np.asarray(self.amount * self.shares * bump * sign(m.omega))


class HarmonicPairs(Effect):
    """Torque ripple of pole pairs and slots, three harmonics that are no multiples of one another."""

    near, start = ("actuator.cogging",), 0.03

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.cycles = rng.uniform(8, 14) * np.array([1.0, rng.uniform(1.6, 1.9), rng.uniform(2.7, 3.4)])
        self.sizes, self.phases = rng.uniform(0.5, 1.0, 3), rng.uniform(0, 2 * np.pi, 3)

    def reaction(self, m: Motion, tau: Array) -> Array:
        parts = zip(self.cycles, self.sizes, self.phases, strict=True)
        return np.asarray(self.amount * self.shares * sum(s * np.sin(c * m.theta + p) for c, s, p in parts))


class MagneticDetent(Effect):
    """A detent with a sharp notch at each pole: a narrow restoring torque that repeats over the angle."""

    near, start = ("actuator.cogging",), 0.03

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.cycles, self.phase = float(rng.uniform(15, 40)), float(rng.uniform(0, 2 * np.pi))

    def reaction(self, m: Motion, tau: Array) -> Array:
        angle = self.cycles * m.theta + self.phase
        return np.asarray(self.amount * self.shares * np.sin(angle) * np.exp(6 * (np.cos(angle) - 1)))


class Ratchet(Effect):
    """A pawl clicks over teeth in one direction: a saw-tooth torque while turning that way."""

    start = 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.pitch, self.way = float(rng.uniform(0.03, 0.1)), float(rng.choice([-1, 1]))

    def reaction(self, m: Motion, tau: Array) -> Array:
        tooth = np.mod(self.way * m.theta / self.pitch, 1.0)
        return self.amount * self.shares * self.way * tooth * np.clip(sign(self.way * m.omega), 0, 1)


class OilWarms(Effect):
    """Viscous friction is high at first and falls as the oil warms through the session."""

    start = 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.tau = float(rng.uniform(60, 200))

    def reaction(self, m: Motion, tau: Array) -> Array:
        cold = np.exp(-(m.since + m.t) / self.tau)[:, None]
        return self.amount * self.shares * cold * m.omega


class _Shaken(Effect):
    """The base accelerates; links, load and accelerometer feel the base's motion, encoders do not."""

    def base(self, m: Motion) -> Array:
        """Acceleration of the base, m/s²."""
        raise NotImplementedError

    def reaction(self, m: Motion, tau: Array) -> Array:
        return m.robot.hold(m.theta, -self.base(m))

    def load_force(self, m: Motion, force: Array) -> Array:
        return -self.base(m) @ m.load.moved.T if m.load else np.zeros_like(force)

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        ins = self.lab.instruments
        return f + m.turned(ins.mount, ins.mount_angle, self.base(m))


class FloorVibrates(_Shaken):
    """A pump somewhere: a narrow band of floor vibration between 4 and 9 Hz."""

    start = 0.02

    def draw(self, rng: Generator) -> None:
        self.f = float(rng.uniform(4, 9))

    def base(self, m: Motion) -> Array:
        hum = m.rng(self.salt).standard_normal(m.theta.shape)
        r, w = np.exp(-2 * np.pi * 0.3 / RATE), 2 * np.pi * self.f / RATE
        ringing = lfilter([1], [1, -2 * r * np.cos(w), r * r], hum, axis=0)
        return np.asarray(self.amount * ringing / ringing.std())


class TableWobbles(_Shaken):
    """The table stands on castors: it gives way to the robot's own thrust, with a resonance of 3 to 7 Hz."""

    start = 1e-4

    def draw(self, rng: Generator) -> None:
        self.w, self.zeta = 2 * np.pi * float(rng.uniform(3, 7)), float(rng.uniform(0.05, 0.2))

    def base(self, m: Motion) -> Array:
        # thrust of the links' centres of mass and the load on the table; compliance is the amount
        mu1, mu2 = m.robot.moments
        one, two = m.theta.T
        first = mu1 * np.column_stack([np.cos(one), np.sin(one)])
        second = mu2 * np.column_stack([np.sin(two), -np.cos(two)])
        thrust = -derivative(derivative(first + second))
        if m.load is not None:
            thrust = thrust + m.load.force(m.x, m.v, m.a)
        still = resonator(self.amount * thrust, self.w, self.zeta)
        return derivative(derivative(low_pass(still, 30.0)))


class BeltTeeth(Effect):
    """Belt teeth mesh unevenly: the encoder, on the motor, is off by a ripple over the angle."""

    start, most = 5e-4, 0.02

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.cycles, self.phase = float(rng.uniform(8, 25)), float(rng.uniform(0, 2 * np.pi))

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        wave = np.sin(self.cycles * theta + self.phase) + 0.5 * np.sin(2 * self.cycles * theta)
        return theta + self.amount * self.mask * wave


class CapstanCreeps(Effect):
    """The capstan's cable creeps under load: the motor's encoder runs away with the integral of the torque."""

    start, most = 1e-3, 0.1

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        slipped = np.cumsum(tau, axis=0) / RATE
        return np.asarray(theta + self.amount * self.mask * (slipped - slipped[0]))


class Backlash(Effect):
    """Gear play between encoder and link, taken up by the torque's sign, with a ring at each impact."""

    start, most = 1e-3, 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.ring, self.click = float(rng.uniform(18, 35)), float(rng.uniform(5, 20))

    def _side(self, tau: Array) -> Array:
        return first_order(np.tanh(low_pass(tau, 20.0) / 0.05), 0.01)

    def reaction(self, m: Motion, tau: Array) -> Array:
        hits = derivative(self._side(tau)) / RATE
        w, r = 2 * np.pi * self.ring / RATE, np.exp(-2 * np.pi * 4 / RATE)
        return (
            self.amount
            * self.click
            * self.mask
            * lfilter([1, -1], [1, -2 * r * np.cos(w), r * r], hits, axis=0)
        )

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        return theta + 0.5 * self.amount * self.mask * self._side(tau)


class RubberBushing(Effect):
    """A rubber bushing on one joint: hysteresis whose backbone hardens, in angle."""

    near, start = ("friction.presliding", "elastic.joint", "friction.coulomb"), 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.width = float(rng.uniform(0.03, 0.12))

    def reaction(self, m: Motion, tau: Array) -> Array:
        d = m.theta - np.array(self.lab.centre)
        loop = np.column_stack([slip(m.theta[:, j], self.width, 0.6) for j in range(2)])
        return np.asarray(self.amount * self.shares * (loop + (d / 0.2) ** 3))


ALL: list[type[Effect]] = [
    CableMaxwellSlip, AirLineMemory, FractionalDamping, PowerLawFriction, CoupledDrag, GyroscopicMotor,
    CounterweightCrank, HangingPendulum, BearingSticks, HarmonicPairs, MagneticDetent, Ratchet, OilWarms,
    FloorVibrates, TableWobbles, BeltTeeth, CapstanCreeps, Backlash, RubberBushing,
]  # fmt: skip
