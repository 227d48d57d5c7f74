"""More effects of the robot without a name in the catalogue: contacts, springs, brakes, bending."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from ..mechanics import Array
from ..motion import RATE, Motion, derivative, low_pass
from .base import COARSE, Effect, first_order, sign


def age(omega: Array, slide: float) -> Array:
    """Age of a contact in s (Dieterich): it grows at rest and is worn off within ``slide`` rad; (n,)."""
    step, out, old = COARSE / RATE, [], 1.0
    for speed in np.abs(omega[::COARSE]).tolist():
        old = (old + step) / (1 + step * speed / slide)
        out.append(old)
    return np.asarray(np.interp(np.arange(omega.size), np.arange(len(out)) * COARSE, out))


def thrust(m: Motion) -> Array:
    """Force that holds the first joint's bearing: the links' centres of mass accelerated, less the load's push."""
    mu1, mu2 = m.robot.moments
    one, two = m.theta.T
    centres = mu1 * np.column_stack([np.cos(one), np.sin(one)])
    centres += mu2 * np.column_stack([np.sin(two), -np.cos(two)])
    push = np.zeros_like(m.x) if m.load is None else m.load.force(m.x, m.v, m.a)
    return derivative(derivative(centres)) - push


class AgeingContact(Effect):
    """Dry friction with the logarithm of the contact's age: whatever has rested sticks harder (rate and state)."""

    near, start = ("friction.stribeck", "friction.coulomb"), 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.slide, self.growth = float(rng.uniform(0.01, 0.05)), float(rng.uniform(0.3, 0.6))

    def reaction(self, m: Motion, tau: Array) -> Array:
        ages = np.column_stack([age(m.omega[:, j], self.slide) for j in range(2)])
        return self.amount * self.shares * sign(m.omega) * (0.5 + self.growth * np.log1p(ages / 0.02))


class LaggingStribeck(Effect):
    """The oil film builds up late: Stribeck's friction follows a speed of some hundredths of a second ago."""

    near, start = ("friction.stribeck", "friction.coulomb"), 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.lag, self.speed = float(rng.uniform(0.05, 0.2)), float(rng.uniform(0.1, 0.4))

    def reaction(self, m: Motion, tau: Array) -> Array:
        film = first_order(np.abs(m.omega), self.lag)
        return self.amount * self.shares * sign(m.omega) * (0.3 + np.exp(-((film / self.speed) ** 1.5)))


class BearingSideLoad(Effect):
    """The first bearing's dry friction grows with the side force on it, not with the torque through it."""

    near, start = ("friction.load", "friction.coulomb"), 0.005

    def draw(self, rng: Generator) -> None:
        self.where, self.ground = ["joint1"], float(rng.uniform(0, 0.5))

    def reaction(self, m: Motion, tau: Array) -> Array:
        side = np.linalg.norm(thrust(m), axis=1)
        drag = self.amount * (side + self.ground) * sign(m.omega[:, 0])
        return np.column_stack([drag, np.zeros_like(drag)])


class SoftStop(Effect):
    """One joint runs into a rubber stop on one side: force with the power 3/2 of the way in."""

    near, start = ("elastic.joint",), 1.0

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.side = float(rng.choice([-1, 1]))
        self.at = np.array(self.lab.centre) + self.side * np.radians(rng.uniform(0, 3))

    def reaction(self, m: Motion, tau: Array) -> Array:
        way_in = np.clip(self.side * (m.theta - self.at), 0, None)
        return np.asarray(self.amount * self.mask * self.side * way_in**1.5)


class TautString(Effect):
    """A hose hangs slack until the end point is far from its hook, then pulls towards the hook."""

    near, start = ("elastic.cartesian",), 10.0

    def draw(self, rng: Generator) -> None:
        way, far = rng.uniform(0, 2 * np.pi), rng.uniform(0.12, 0.4)
        self.hook = self.lab.home + far * np.array([np.cos(way), np.sin(way)])
        self.slack = far + float(rng.uniform(-0.01, 0.01))

    def reaction(self, m: Motion, tau: Array) -> Array:
        away = m.x - self.hook
        length = np.linalg.norm(away, axis=1, keepdims=True)
        pull = self.amount * np.clip(length - self.slack, 0, None) * away / length
        return m.robot.to_joints(m.theta, pull)


class CounterbalanceSpring(Effect):
    """A coil spring of some free length from the frame to a point of the link, off its line."""

    near, start = ("elastic.joint", "gravity.link"), 20.0

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.crank, self.post = float(rng.uniform(0.04, 0.08)), float(rng.uniform(0.06, 0.12))
        self.turned = float(rng.choice([-1, 1]) * rng.uniform(0.1, 1.2))
        self.free_length = float(rng.uniform(0.3, 0.9) * abs(self.post - self.crank))

    def stretch(self, m: Motion) -> tuple[Array, Array]:
        """Length of the spring and its slope over the angle, each (n, 2)."""
        angle = m.theta - np.array(self.lab.centre) - self.turned
        length = np.sqrt(self.crank**2 + self.post**2 - 2 * self.crank * self.post * np.cos(angle))
        return length, self.crank * self.post * np.sin(angle) / length

    def reaction(self, m: Motion, tau: Array) -> Array:
        length, slope = self.stretch(m)
        return self.amount * self.mask * (length - self.free_length) * slope


class TableMagnet(Effect):
    """A magnet in the table draws the end point in, or pushes it off, and is hardly felt from afar."""

    near, start = ("elastic.cartesian",), 10.0

    def draw(self, rng: Generator) -> None:
        self.at, self.depth = self.lab.home + rng.normal(0, 0.02, 2), float(rng.uniform(0.02, 0.05))
        self.way = float(rng.choice([-1, 1]))

    def reaction(self, m: Motion, tau: Array) -> Array:
        away = m.x - self.at
        fade = (1 + (away**2).sum(1, keepdims=True) / self.depth**2) ** -2.5
        return m.robot.to_joints(m.theta, self.way * self.amount * fade * away)


class BrakePatch(Effect):
    """Spilt glue: the end point is damped on one patch of the table only."""

    near, start = ("damping.cartesian",), 3.0

    def draw(self, rng: Generator) -> None:
        self.at, self.width = self.lab.home + rng.normal(0, 0.015, 2), float(rng.uniform(0.01, 0.03))

    def reaction(self, m: Motion, tau: Array) -> Array:
        away = ((m.x - self.at) ** 2).sum(1, keepdims=True)
        return m.robot.to_joints(m.theta, self.amount * np.exp(-0.5 * away / self.width**2) * m.v)


class EddyBrake(Effect):
    """An eddy current brake: drag grows with the speed, is largest at a critical one and falls beyond."""

    near, start = ("friction.coulomb", "friction.stribeck"), 0.1

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.critical = float(rng.uniform(0.15, 0.6))

    def reaction(self, m: Motion, tau: Array) -> Array:
        return self.amount * self.shares * m.omega / (1 + (m.omega / self.critical) ** 2)


class DraggedRing(Effect):
    """A loose ring in grease on the shaft: the joint drags it along, and it lags by its own time."""

    near, start = ("inertia.extra",), 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.lag = float(rng.uniform(0.08, 0.6))

    def reaction(self, m: Motion, tau: Array) -> Array:
        return self.amount * self.shares * (m.omega - first_order(m.omega, self.lag))


class GovernorShoes(Effect):
    """Brake shoes on the elbow are thrown outward by the first link's turning: dry friction with its square."""

    near, start = ("friction.coulomb",), 0.05

    def draw(self, rng: Generator) -> None:
        self.where = ["joint2"]

    def reaction(self, m: Motion, tau: Array) -> Array:
        drag = self.amount * m.omega[:, 0] ** 2 * sign(m.omega[:, 1])
        return np.column_stack([np.zeros_like(drag), drag])


class LinkBends(Effect):
    """A link bends sideways under its joint's torque: accelerometer and load feel it, encoders do not."""

    near, start, most = ("elastic.transmission",), 1e-4, 0.01

    def draw(self, rng: Generator) -> None:
        self.which = int(rng.integers(2))
        self.where = [f"joint{self.which + 1}"]

    def bent(self, m: Motion) -> Array:
        """Way of the end point from where the angles say it is, m."""
        tau = m.robot.inverse(m.theta, m.omega, m.accel)
        if m.load is not None:
            tau = tau - m.robot.to_joints(m.theta, m.load.force(m.x, m.v, m.a))
        angle = m.theta[:, self.which]
        sideways = np.column_stack([-np.sin(angle), np.cos(angle)])
        if self.which == 1:  # the second link's axis stands a quarter turn behind its angle
            sideways = np.column_stack([np.cos(angle), np.sin(angle)])
        return np.asarray(-self.amount * low_pass(tau[:, [self.which]], 20.0) * sideways)

    def load_force(self, m: Motion, force: Array) -> Array:
        load, d = m.load, self.bent(m)
        assert load is not None
        speed = derivative(d)
        return -(derivative(speed) @ load.moved.T + speed @ load.B.T + d @ load.K.T)

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        ins = self.lab.instruments
        return f + m.turned(ins.mount, ins.mount_angle, derivative(derivative(self.bent(m))))


class LoomStiffens(Effect):
    """The cable loom across the elbow is slack in the middle and stiff at both ends: the angle's cube."""

    near, start = ("elastic.joint",), 0.05

    def draw(self, rng: Generator) -> None:
        self.where = ["joint1", "joint2"]
        self.rest = self.lab.centre[0] - self.lab.centre[1] + float(rng.normal(0, 0.05))

    def reaction(self, m: Motion, tau: Array) -> Array:
        pull = self.amount * ((m.theta[:, 0] - m.theta[:, 1] - self.rest) / 0.2) ** 3
        return np.column_stack([pull, -pull])


class CoggingFades(Effect):
    """Cogging that is there at creeping speed and gone at full speed."""

    near, start = ("actuator.cogging",), 0.03

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.2)
        self.cycles, self.phase = rng.uniform(12, 40, 2), rng.uniform(0, 2 * np.pi, 2)
        self.speed = float(rng.uniform(0.05, 0.3))

    def reaction(self, m: Motion, tau: Array) -> Array:
        wave = np.sin(self.cycles * m.theta + self.phase)
        return self.amount * self.shares * wave / (1 + (m.omega / self.speed) ** 2)


class SectorSteps(Effect):
    """Commutation by sectors, each a little off: a torque that is constant within a sector and steps between."""

    start = 0.02

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.width, self.levels = float(rng.uniform(0.05, 0.15)), rng.normal(0, 1, 401)

    def reaction(self, m: Motion, tau: Array) -> Array:
        place = m.theta / self.width + 200
        sector = np.clip(np.floor(place).astype(int), 0, 399)
        edge = np.clip((place - sector - 0.9) / 0.1, 0, 1)
        level = self.levels[sector] + (self.levels[sector + 1] - self.levels[sector]) * edge
        return np.asarray(self.amount * self.mask * level)


ALL: list[type[Effect]] = [
    AgeingContact, LaggingStribeck, BearingSideLoad, SoftStop, TautString, CounterbalanceSpring, TableMagnet,
    BrakePatch, EddyBrake, DraggedRing, GovernorShoes, LinkBends, LoomStiffens, CoggingFades, SectorSteps,
]  # fmt: skip
