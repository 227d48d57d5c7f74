"""More effects of loads, arm, grip and room without a name in the catalogue."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from ..mechanics import Array
from ..motion import Motion
from .base import Effect, first_order, shifted
from .fresh_drives import slow
from .loads import LoadEffect, the_load
from .odd_machine import _Shaken


def heading(rng: Generator) -> Array:
    way = rng.uniform(0, 2 * np.pi)
    return np.array([np.cos(way), np.sin(way)])


class _Arm(LoadEffect):
    only, needs = "arm", frozenset({"arm"})


class DampingByPlace(LoadEffect):
    """The load is damped the more the further it is pushed to one side: speed times place."""

    near, start = ("load.damping",), 40.0

    def shape(self, rng: Generator) -> None:
        self.way, self.edge = heading(rng), float(rng.uniform(0.005, 0.03))

    def load_force(self, m: Motion, force: Array) -> Array:
        side = np.clip((m.x - self.lab.home) @ self.way + self.edge, 0, None)
        return -self.amount * side[:, None] * m.v


class YieldsWithSpeed(_Arm):
    """Short-range stiffness: the muscle's cross-bridges hold while it creeps and let go while it moves."""

    near, start, K_defined = ("load.time_varying", "load.hysteresis"), 30.0, False

    def shape(self, rng: Generator) -> None:
        self.speed = float(rng.uniform(0.03, 0.12))

    def load_force(self, m: Motion, force: Array) -> Array:
        fast = np.linalg.norm(m.v, axis=1, keepdims=True)
        return np.asarray(-self.amount * np.exp(-fast / self.speed) * (m.x - the_load(m).x0))


class StiffensWhenShaken(_Arm):
    """The subject stiffens while shaken hard: the stiffness follows the speed's mean over a second or two."""

    near, start, K_defined = ("load.time_varying", "load.stiffness_cubic"), 0.5, False

    def shape(self, rng: Generator) -> None:
        self.lag = float(rng.uniform(0.3, 2))

    def load_force(self, m: Motion, force: Array) -> Array:
        load = the_load(m)
        shaken = first_order(np.linalg.norm(m.v, axis=1, keepdims=True), self.lag)
        return -self.amount * shaken * ((m.x - load.x0) @ load.K.T)


class GripYields(_Arm):
    """The hand's flesh lies between handle and arm: the arm's force arrives through a share that lags."""

    near, start, most = ("load.delay", "load.time_varying"), 0.05, 0.9
    K_defined = False

    def shape(self, rng: Generator) -> None:
        self.lag = float(rng.uniform(0.03, 0.15))

    def load_force(self, m: Motion, force: Array) -> Array:
        arm = force + m.a * the_load(m).handle  # the handle is on the robot's side of the flesh
        return self.amount * (first_order(arm, self.lag) - arm)


class TouchesEdge(LoadEffect):
    """The load comes against a padded edge: a one-sided spring with damping by depth (Hunt and Crossley)."""

    near, start, K_defined = ("load.stiffness_cubic", "load.deadzone"), 200.0, False

    def shape(self, rng: Generator) -> None:
        self.way, self.edge = heading(rng), float(rng.uniform(0.004, 0.012))
        self.loss = float(rng.uniform(0.5, 3))

    def load_force(self, m: Motion, force: Array) -> Array:
        depth = np.clip((m.x - self.lab.home) @ self.way - self.edge, 0, None)
        push = np.clip(depth * (1 + self.loss * (m.v @ self.way)), 0, None)
        return -self.amount * np.outer(push, self.way)


class Heartbeat(_Arm):
    """The heart's recoil reaches the hand: short two-sided kicks about once a second, never quite regular."""

    start = 0.3

    def shape(self, rng: Generator) -> None:
        self.rate, self.way, self.width = (
            float(rng.uniform(0.9, 1.6)),
            heading(rng),
            float(rng.uniform(0.04, 0.08)),
        )

    def load_force(self, m: Motion, force: Array) -> Array:
        rng, kicks, when = m.rng(self.salt), np.zeros_like(m.t), float(m.t[0])
        while when < m.t[-1]:
            when += rng.normal(1, 0.06) / self.rate
            u = (m.t - when) / self.width
            kicks += -u * np.exp(0.5 - 0.5 * u**2) + 0.4 * np.exp(-0.5 * (u - 3) ** 2)
        return self.amount * np.outer(kicks, self.way)


class StretchCatch(_Arm):
    """A spastic muscle answers fast stretch, in one direction, above a threshold, some hundredths of a second late."""

    near, start, most = ("load.delay",), 10.0, 300.0

    def shape(self, rng: Generator) -> None:
        self.way, self.delay = heading(rng), float(rng.uniform(0.03, 0.08))
        self.threshold, self.decay = float(rng.uniform(0.005, 0.02)), float(rng.uniform(0.05, 0.2))

    def load_force(self, m: Motion, force: Array) -> Array:
        over = np.clip(m.v @ self.way - self.threshold, 0, None)[:, None]
        tension = first_order(shifted(over, self.delay, m.t), self.decay)
        return -self.amount * tension * self.way


class PushesAlong(_Arm):
    """The subject feels where it goes and helps: a force along the motion that has its full size at any speed."""

    near, start = ("load.hysteresis", "load.damping"), 0.3

    def shape(self, rng: Generator) -> None:
        self.speed, self.late = float(rng.uniform(0.01, 0.04)), float(rng.uniform(0.1, 0.25))

    def load_force(self, m: Motion, force: Array) -> Array:
        felt = shifted(m.v, self.late, m.t)
        speed = np.linalg.norm(felt, axis=1, keepdims=True)
        return np.asarray(self.amount * np.tanh(speed / self.speed) * felt / np.maximum(speed, 1e-9))


class CorrectsByGlances(_Arm):
    """Intermittent control: a few times a second the subject looks, and holds a correcting force until the next look."""

    near, start, K_defined = ("load.delay",), 20.0, False

    def shape(self, rng: Generator) -> None:
        self.every = float(rng.uniform(0.25, 0.6))

    def load_force(self, m: Motion, force: Array) -> Array:
        rng, source, when = m.rng(self.salt), np.arange(m.t.size), float(m.t[0])
        while when < m.t[-1]:
            first = int(np.searchsorted(m.t, when))
            when += self.every * rng.uniform(0.7, 1.3)
            source[first : int(np.searchsorted(m.t, when))] = min(first, m.t.size - 1)
        held = (m.x - the_load(m).x0)[source]
        return -self.amount * first_order(held, 0.03)


class SpinningPayload(LoadEffect):
    """A wheel spins in the payload's gimbal: a force across the motion, which does no work."""

    near, only, needs, start = ("load.damping",), "mass-spring", frozenset({"mass-spring"}), 1.0

    def shape(self, rng: Generator) -> None:
        self.way = float(rng.choice([-1, 1]))

    def load_force(self, m: Motion, force: Array) -> Array:
        return self.way * self.amount * np.column_stack([m.v[:, 1], -m.v[:, 0]])


class MetronomePush(_Arm):
    """The subject pushes to a metronome that somebody left on: a rounded square wave of fixed beat."""

    start = 0.4

    def shape(self, rng: Generator) -> None:
        self.beat, self.way = float(rng.uniform(0.6, 1.6)), heading(rng)

    def load_force(self, m: Motion, force: Array) -> Array:
        wave = np.tanh(3 * np.sin(2 * np.pi * self.beat * (m.since + m.t)))
        return self.amount * np.outer(wave, self.way)


class TensionByDirectionOfPull(_Arm):
    """Muscles pull and never push: along each axis the arm is stiffer while it shortens than while it lengthens."""

    near, start, K_defined = ("load.hysteresis", "load.damping"), 20.0, False

    def shape(self, rng: Generator) -> None:
        self.speed = float(rng.uniform(0.01, 0.05))

    def load_force(self, m: Motion, force: Array) -> Array:
        d = m.x - the_load(m).x0
        return -self.amount * d * np.tanh(m.v * d / (np.abs(d) + 1e-3) / self.speed)


class TableTips(_Shaken):
    """The table stands on soft feet: as the robot's weight moves out, the plane tips, and all feel its slope."""

    near, start = ("elastic.cartesian", "gravity.tilt"), 1.0

    def draw(self, rng: Generator) -> None:
        self.soft = np.array([1.0, rng.uniform(0.2, 1.0)])

    def base(self, m: Motion) -> Array:
        return -self.amount * self.soft * first_order(m.x - self.lab.home, 0.02)


class Footsteps(_Shaken):
    """Somebody walks past during a part of each trial: a dull thud with each step."""

    start = 0.1

    def draw(self, rng: Generator) -> None:
        self.way, self.f, self.pace = heading(rng), float(rng.uniform(4, 9)), float(rng.uniform(0.45, 0.65))

    def base(self, m: Motion) -> Array:
        rng, out = m.rng(self.salt), np.zeros_like(m.t)
        when = m.plan.duration * float(rng.uniform(0.05, 0.5))
        last = when + 0.4 * m.plan.duration
        while when < last:
            after = np.clip(m.t - when, 0, None)
            out += rng.uniform(0.6, 1.2) * np.exp(-after / 0.12) * np.sin(2 * np.pi * self.f * after)
            when += self.pace * float(rng.normal(1, 0.05))
        return self.amount * np.outer(out, self.way)


class FanBlows(Effect):
    """A fan blows over the end point in gusts: drag with the square of the speed against the air."""

    near, start = ("damping.cartesian", "friction.quadratic"), 0.3

    def draw(self, rng: Generator) -> None:
        self.way, self.wind = heading(rng), float(rng.uniform(0.5, 2))

    def reaction(self, m: Motion, tau: Array) -> Array:
        gusts = self.wind * np.clip(1 + 0.4 * slow(m, self.salt, 0.6), 0.1, None)
        against = m.v - gusts[:, None] * self.way
        drag = self.amount * np.linalg.norm(against, axis=1, keepdims=True) * against
        return m.robot.to_joints(m.theta, drag)


class DoorDraught(Effect):
    """A door is opened once in a trial: the cable's rest moves with the air and swings back within seconds."""

    near, start = ("elastic.cartesian",), 0.3

    def draw(self, rng: Generator) -> None:
        self.way, self.f = heading(rng), float(rng.uniform(0.3, 0.8))

    def reaction(self, m: Motion, tau: Array) -> Array:
        after = np.clip(m.t - m.plan.duration * m.rng(self.salt).uniform(0.1, 0.6), 0, None)
        swing = np.exp(-after / 2.5) * np.sin(2 * np.pi * self.f * after)
        return m.robot.to_joints(m.theta, self.amount * np.outer(swing, self.way))


ALL: list[type[Effect]] = [
    DampingByPlace, YieldsWithSpeed, StiffensWhenShaken, GripYields, TouchesEdge, Heartbeat, StretchCatch,
    PushesAlong, CorrectsByGlances, SpinningPayload, MetronomePush, TensionByDirectionOfPull, TableTips, Footsteps,
    FanBlows, DoorDraught,
]  # fmt: skip
