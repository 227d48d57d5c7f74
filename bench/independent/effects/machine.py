"""Effects of the robot that have a name in the catalogue: friction, springs, weight, inertia, drives."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator

from ..mechanics import Array
from ..motion import RATE, Motion, derivative, low_pass
from .base import Effect, shifted, sign, slip, turn


class DryFriction(Effect):
    name, start = "friction.coulomb", 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)

    def reaction(self, m: Motion, tau: Array) -> Array:
        return self.amount * self.shares * sign(m.omega)

    def parameters(self) -> dict[str, Any]:
        return {"torque": self.per_joint(self.amount * self.shares)}


class StribeckFriction(Effect):
    """Dry friction that rises towards standstill, exponent between 1 and 2."""

    name, with_, start = "friction.stribeck", ("friction.coulomb",), 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.speed, self.exponent = float(rng.uniform(0.04, 0.2)), float(rng.uniform(1, 2))
        self.ground = float(rng.uniform(0.0, 0.8))

    def reaction(self, m: Motion, tau: Array) -> Array:
        rise = np.exp(-(np.abs(m.omega / self.speed) ** self.exponent))
        return self.amount * self.shares * sign(m.omega) * (self.ground + rise)

    def parameters(self) -> dict[str, Any]:
        rise = self.per_joint(self.amount * self.shares)
        return {"rise": rise, "coulomb_share": self.ground, "speed": self.speed, "exponent": self.exponent}


class UnequalFriction(Effect):
    name, with_, start = "friction.asymmetric", ("friction.coulomb",), 0.05
    instead = (("friction.coulomb", "actuator.offset"),)

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.back = rng.uniform(0.1, 0.6, 2)
        self.way = rng.choice([-1, 1], 2)

    def reaction(self, m: Motion, tau: Array) -> Array:
        s = sign(m.omega)
        return self.amount * self.shares * np.where(s * self.way > 0, s, self.back * s)

    def parameters(self) -> dict[str, Any]:
        return {"torque": self.per_joint(self.amount * self.shares), "other_way": self.back.tolist()}


class SpeedSquaredDrag(Effect):
    name, start = "friction.quadratic", 0.02

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)

    def reaction(self, m: Motion, tau: Array) -> Array:
        return self.amount * self.shares * m.omega * np.abs(m.omega)

    def parameters(self) -> dict[str, Any]:
        return {"coefficient": self.per_joint(self.amount * self.shares)}


class FrictionByAngle(Effect):
    """Dry friction with one wave over the angle on top of its mean."""

    name, with_, start = "friction.position", ("friction.coulomb",), 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.15)
        self.period, self.phase = float(rng.uniform(0.15, 0.5)), float(rng.uniform(0, 2 * np.pi))
        self.depth = float(rng.uniform(0.5, 1.0))

    def reaction(self, m: Motion, tau: Array) -> Array:
        wave = 1 + self.depth * np.cos(2 * np.pi * m.theta / self.period + self.phase)
        return self.amount * self.shares * wave * sign(m.omega)

    def parameters(self) -> dict[str, Any]:
        torque = self.per_joint(self.amount * self.shares)
        return {"mean": torque, "depth": self.depth, "period_rad": self.period, "phase_rad": self.phase}


class FrictionUnderLoad(Effect):
    """Dry friction in proportion to the torque that passes the joint."""

    name, start, most = "friction.load", 0.05, 0.6

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)

    def reaction(self, m: Motion, tau: Array) -> Array:
        return self.amount * self.shares * np.abs(tau) * sign(m.omega)

    def parameters(self) -> dict[str, Any]:
        return {"coefficient": self.per_joint(self.amount * self.shares)}


class Presliding(Effect):
    """Dahl friction: a spring until it slides."""

    name, with_, start = "friction.presliding", ("friction.coulomb",), 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.width = float(rng.uniform(0.01, 0.06))

    def reaction(self, m: Motion, tau: Array) -> Array:
        columns = [self.mask[j] and slip(m.theta[:, j], self.width) for j in range(2)]
        both = np.column_stack([np.broadcast_to(c, m.t.shape) for c in columns])
        return np.asarray(self.amount * self.shares * both)

    def parameters(self) -> dict[str, Any]:
        return {"torque": self.per_joint(self.amount * self.shares), "width_rad": self.width}


class Cable(Effect):
    """A cable pulls at the end point: a symmetric stiffness with an entry xy, and a place of rest."""

    name, start = "elastic.cartesian", 5.0

    def draw(self, rng: Generator) -> None:
        axes = turn(float(rng.uniform(0, np.pi)))
        self.K = axes @ np.diag([1.0, rng.uniform(0.05, 0.8)]) @ axes.T
        self.rest = self.lab.home + rng.normal(0, 0.05, 2)

    def reaction(self, m: Motion, tau: Array) -> Array:
        return m.robot.to_joints(m.theta, self.amount * (m.x - self.rest) @ self.K.T)

    def parameters(self) -> dict[str, Any]:
        return {"K": (self.amount * self.K).tolist(), "rest": self.rest.tolist()}


class CableInLoadTrials(Cable):
    """The force sensor's cable, there in load trials only (so a force sensor tells it from the load)."""

    whens, needs = ("load",), frozenset({"force_sensor"})


class JointSpring(Effect):
    name, start = "elastic.joint", 0.2

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.rest = np.array(self.lab.centre) + rng.normal(0, 0.3, 2)

    def reaction(self, m: Motion, tau: Array) -> Array:
        return self.amount * self.shares * (m.theta - self.rest)

    def parameters(self) -> dict[str, Any]:
        return {"stiffness": self.per_joint(self.amount * self.shares), "rest_rad": self.rest.tolist()}


class ElbowSpring(Effect):
    """A cable loom across the elbow resists the angle between the links."""

    name, start = "elastic.joint", 0.2

    def draw(self, rng: Generator) -> None:
        self.where = ["joint1", "joint2"]
        self.rest = float(rng.normal(0, 0.3))

    def reaction(self, m: Motion, tau: Array) -> Array:
        pull = self.amount * (m.theta[:, 0] - m.theta[:, 1] - self.rest)
        return np.column_stack([pull, -pull])

    def parameters(self) -> dict[str, Any]:
        return {"stiffness": self.amount, "between": "theta1 - theta2", "rest_rad": self.rest}


class SoftTransmission(Effect):
    """Encoder and a share of the inertia on the motor's side of a spring (``amount`` is its compliance)."""

    name, start, most = "elastic.transmission", 1e-3, 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.rotor = rng.uniform(0.1, 0.4, 2) * np.array([self.lab.robot.alpha[0], self.lab.robot.alpha[2]])

    def _twist(self, tau: Array) -> Array:
        return self.amount * self.shares * low_pass(tau, 25.0)

    def reaction(self, m: Motion, tau: Array) -> Array:
        passed = tau - self.rotor * m.accel
        return np.asarray(self.rotor * derivative(derivative(self._twist(passed))))

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        return theta + self._twist(tau - self.rotor * m.accel)

    def parameters(self) -> dict[str, Any]:
        return {
            "stiffness": self.per_joint(1 / np.maximum(self.amount * self.shares, 1e-12)),
            "motor_inertia": self.per_joint(self.rotor),
        }


class TipDamping(Effect):
    """A damper or eddy currents at the end point, with an entry xy."""

    name, start = "damping.cartesian", 1.0

    def draw(self, rng: Generator) -> None:
        axes = turn(float(rng.uniform(0, np.pi)))
        self.B = axes @ np.diag([1.0, rng.uniform(0.1, 0.9)]) @ axes.T

    def reaction(self, m: Motion, tau: Array) -> Array:
        return m.robot.to_joints(m.theta, self.amount * m.v @ self.B.T)

    def parameters(self) -> dict[str, Any]:
        return {"B": (self.amount * self.B).tolist()}


class TiltedTable(Effect):
    """The plane is not level: links, payload and accelerometer all feel it (an arm hangs in its sling)."""

    name, start, most = "gravity.tilt", 0.1, 3.0

    def draw(self, rng: Generator) -> None:
        way = rng.uniform(0, 2 * np.pi)
        self.g = np.array([np.cos(way), np.sin(way)])

    def reaction(self, m: Motion, tau: Array) -> Array:
        return m.robot.hold(m.theta, self.amount * self.g)

    def load_force(self, m: Motion, force: Array) -> Array:
        load = m.load
        assert load is not None
        mass = load.M[0, 0] if load.kind == "mass-spring" else load.handle
        return np.broadcast_to(mass * self.amount * self.g, force.shape)

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        ins = self.lab.instruments
        g = np.broadcast_to(self.amount * self.g, f.shape)
        return f - m.turned(ins.mount, ins.mount_angle, g)

    def parameters(self) -> dict[str, Any]:
        return {"gx": self.amount * float(self.g[0]), "gy": self.amount * float(self.g[1])}


class CouplingRotor(Effect):
    """The second motor sits on the first link; its geared rotor couples both joints with a constant inertia."""

    name, start, any_joint = "inertia.extra", 0.01, True

    def draw(self, rng: Generator) -> None:
        self.where = ["joint1", "joint2"]
        self.ratio = float(rng.choice([-1, 1]) * rng.uniform(2, 12))

    def reaction(self, m: Motion, tau: Array) -> Array:
        # rotor speed ω1 + n (ω2 - ω1), kinetic energy ½ J of it; J = amount / n²
        row = np.array([1 - self.ratio, self.ratio]) / self.ratio
        return self.amount * (m.accel @ row)[:, None] * row

    def parameters(self) -> dict[str, Any]:
        n = self.ratio
        return {"inertia": self.amount / n**2, "ratio": n, "I12": self.amount * (1 - n) / n}


class PlateInLoadTrials(Effect):
    """An adapter between robot and force sensor that nobody weighed, there in load trials only."""

    name, whens, needs, start = "inertia.extra", ("load",), frozenset({"force_sensor"}), 0.05

    def reaction(self, m: Motion, tau: Array) -> Array:
        return m.robot.to_joints(m.theta, self.amount * m.a)

    def parameters(self) -> dict[str, Any]:
        return {"mass": self.amount}


class TorqueConstant(Effect):
    """Logged torque is off by a factor; something weighed or a force sensor is there to tell."""

    name, needs, start, most = "actuator.gain", frozenset({"force_sensor"}), 0.03, 0.5

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.shares = self.shares * rng.choice([-1, 1])

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau / (1 + self.amount * self.shares)

    def parameters(self) -> dict[str, Any]:
        return {"gain": self.per_joint(1 + self.amount * self.shares)}


class TorqueConstantWeighed(TorqueConstant):
    needs = frozenset({"weighed"})


class TorqueOffset(Effect):
    name, start = "actuator.offset", 0.02

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.shares = self.shares * rng.choice([-1, 1], 2)

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau - self.amount * self.shares

    def parameters(self) -> dict[str, Any]:
        return {"torque": self.per_joint(self.amount * self.shares)}


class Cogging(Effect):
    name, start = "actuator.cogging", 0.02

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.2)
        self.cycles, self.phase = rng.uniform(12, 70, 2), rng.uniform(0, 2 * np.pi, 2)

    def reaction(self, m: Motion, tau: Array) -> Array:
        return self.amount * self.shares * np.sin(self.cycles * m.theta + self.phase)

    def parameters(self) -> dict[str, Any]:
        return {
            "amplitude": self.per_joint(self.amount * self.shares),
            "cycles_per_rad": self.per_joint(self.cycles),
            "phase_rad": self.per_joint(self.phase),
        }


class TorqueLogLate(Effect):
    name, start, most = "actuator.delay", 0.003, 0.05

    def draw(self, rng: Generator) -> None:
        self.where, self.way = ["joint1", "joint2"], float(rng.choice([-1, 1], p=[0.25, 0.75]))

    def drive(self, m: Motion, tau: Array) -> Array:
        return shifted(tau, self.way * self.amount, m.t)

    def parameters(self) -> dict[str, Any]:
        return {"delay": self.way * self.amount}


class DriveLag(Effect):
    """The log holds commands; the drive follows them as a first-order lag."""

    name, start, most = "actuator.lag", 0.003, 0.06

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.6)

    def drive(self, m: Motion, tau: Array) -> Array:
        smooth = low_pass(tau, 60.0, RATE)
        return tau + self.amount * self.mask * derivative(smooth)

    def parameters(self) -> dict[str, Any]:
        return {"time_constant": self.per_joint(self.amount * self.mask)}


ALL: list[type[Effect]] = [
    DryFriction, StribeckFriction, UnequalFriction, SpeedSquaredDrag, FrictionByAngle, FrictionUnderLoad, Presliding,
    Cable, CableInLoadTrials, JointSpring, ElbowSpring, SoftTransmission, TipDamping, TiltedTable, CouplingRotor,
    PlateInLoadTrials, TorqueConstant, TorqueConstantWeighed, TorqueOffset, Cogging, TorqueLogLate, DriveLag,
]  # fmt: skip
