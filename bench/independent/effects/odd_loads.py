"""Effects of the load that have no name in the catalogue."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from ..mechanics import Array
from ..motion import RATE, Motion, derivative
from .base import first_order, play, sign
from .loads import LoadEffect, the_load
from .odd_machine import resonator


class _Arm(LoadEffect):
    only, needs = "arm", frozenset({"arm"})


class Tremor(_Arm):
    """The hand trembles at 8 to 10 Hz."""

    start = 0.3

    def shape(self, rng: Generator) -> None:
        self.f, self.way = float(rng.uniform(8, 9.8)), rng.normal(0, 1, 2)

    def load_force(self, m: Motion, force: Array) -> Array:
        w, r = 2 * np.pi * self.f / RATE, np.exp(-2 * np.pi * 0.25 / RATE)
        swing = lfilter([1], [1, -2 * r * np.cos(w), r * r], m.rng(self.salt).standard_normal(m.t.size))
        return self.amount * np.outer(swing / swing.std(), self.way / np.linalg.norm(self.way))


class Breathing(_Arm):
    """Breath pushes the hand, 0.2 to 0.35 Hz, never quite regular."""

    near, start = ("load.drift",), 0.3

    def shape(self, rng: Generator) -> None:
        self.f, self.way = float(rng.uniform(0.2, 0.35)), rng.normal(0, 1, 2)

    def load_force(self, m: Motion, force: Array) -> Array:
        rng = m.rng(self.salt)
        wobble = np.interp(m.t, np.linspace(m.t[0], m.t[-1], 12), rng.normal(0, 0.8, 12))
        wave = np.sin(2 * np.pi * self.f * m.t + wobble + rng.uniform(0, 6.3))
        return self.amount * np.outer(wave + 0.3 * wave**2, self.way / np.linalg.norm(self.way))


class Startle(_Arm):
    """The subject jerks two or three times in a trial: a push of half a second."""

    start = 2.0

    def load_force(self, m: Motion, force: Array) -> Array:
        rng, out = m.rng(self.salt), np.zeros_like(force)
        for _ in range(int(rng.integers(2, 4))):
            at, way = rng.uniform(0, m.plan.duration), rng.normal(0, 1, 2)
            u = np.clip((m.t - at) / rng.uniform(0.3, 0.7), 0, 1)
            out += np.outer(np.sin(np.pi * u) ** 2, way / np.linalg.norm(way))
        return self.amount * out


class HelpsAlong(_Arm):
    """The subject does not let go: a random force below 1 Hz that has nothing to do with the motion."""

    start = 0.5

    def load_force(self, m: Motion, force: Array) -> Array:
        raw = m.rng(self.salt).standard_normal(force.shape)
        slow = first_order(first_order(raw, 0.25), 0.25)
        return np.asarray(self.amount * slow / slow.std())


class Anticipates(_Arm):
    """The subject moves along: a force in proportion to where the hand will be in a third of a second."""

    start = 5.0

    def load_force(self, m: Motion, force: Array) -> Array:
        ahead = np.column_stack([np.interp(m.t + 0.35, m.t, m.x[:, j]) for j in range(2)])
        return self.amount * (ahead - m.x)


class WobblingTissue(_Arm):
    """Soft tissue hangs on the bone: a second mass on a damped spring of 3 to 6 Hz."""

    start = 0.1

    def shape(self, rng: Generator) -> None:
        self.w, self.zeta = 2 * np.pi * float(rng.uniform(2.5, 5)), float(rng.uniform(0.1, 0.3))

    def load_force(self, m: Motion, force: Array) -> Array:
        hung = resonator(m.x, self.w, self.zeta)
        return -self.amount * (self.w**2 * (m.x - hung) + 2 * self.zeta * self.w * (m.v - derivative(hung)))


class HandSlips(_Arm):
    """The hand slides in the handle: a soft spring that gives way beyond a few newtons."""

    near, start = ("load.deadzone", "load.hysteresis"), 0.3

    def shape(self, rng: Generator) -> None:
        self.width = float(rng.uniform(0.004, 0.012))

    def load_force(self, m: Motion, force: Array) -> Array:
        held = np.column_stack([m.x[:, j] - play(m.x[:, j], self.width) for j in range(2)])
        grip = np.tanh(held / self.width * 2) * np.abs(held / self.width) ** 0.5
        return -self.amount * grip * (1 + 0.8 * np.sin(2 * np.pi * 0.11 * m.t))[:, None]


class StressRelaxes(LoadEffect):
    """The load's stiffness has a part that relaxes within a fraction of a second."""

    start = 20.0

    def shape(self, rng: Generator) -> None:
        self.tau, self.shares = float(rng.uniform(0.1, 0.6)), rng.uniform(0.4, 1, 2)

    def load_force(self, m: Motion, force: Array) -> Array:
        return -self.amount * self.shares * (m.x - first_order(m.x, self.tau))


class LoadDrag(LoadEffect):
    """The load stirs a fluid: drag with the square of the speed."""

    near, start = ("load.damping",), 2.0

    def load_force(self, m: Motion, force: Array) -> Array:
        return np.asarray(-self.amount * np.linalg.norm(m.v, axis=1, keepdims=True) * m.v)


class TwoSidedStiffness(LoadEffect):
    """A slack string: the load is stiffer on one side of its rest than on the other."""

    near, start, K_defined = ("load.stiffness_cubic", "load.deadzone"), 10.0, False

    def shape(self, rng: Generator) -> None:
        angle = rng.uniform(0, 2 * np.pi)
        self.way = np.array([np.cos(angle), np.sin(angle)])

    def load_force(self, m: Motion, force: Array) -> Array:
        along = np.clip((m.x - the_load(m).x0) @ self.way, 0, None)
        return -self.amount * np.outer(along, self.way)


class PayloadRubs(LoadEffect):
    """The payload slides on the table: dry friction against its direction of motion in the plane."""

    near, only, needs, start = ("load.hysteresis",), "mass-spring", frozenset({"mass-spring"}), 0.2

    def load_force(self, m: Motion, force: Array) -> Array:
        speed = np.linalg.norm(m.v, axis=1, keepdims=True)
        return np.asarray(-self.amount * m.v / np.maximum(speed, 1e-12) * sign(speed, 0.003))


class SpringsRattle(LoadEffect):
    """A loose hook in the springs strikes its stop now and then: short hits that ring."""

    only, needs, start = "mass-spring", frozenset({"mass-spring"}), 2.0

    def shape(self, rng: Generator) -> None:
        self.f, self.edge = float(rng.uniform(6, 15)), float(rng.uniform(0.2, 0.8))

    def load_force(self, m: Motion, force: Array) -> Array:
        d = m.x - m.x.mean(0)
        hits = np.zeros_like(d)
        crossing = np.diff((d > self.edge * d.std(0)).astype(float), axis=0, prepend=0)
        hits[1:] = crossing[1:]
        w, r = 2 * np.pi * self.f / RATE, np.exp(-2 * np.pi * 2 / RATE)
        return np.asarray(
            self.amount * np.sin(w) * lfilter([0, 1], [1, -2 * r * np.cos(w), r * r], hits, axis=0)
        )


class PayloadTurns(LoadEffect):
    """The payload's centre sits beside the end point and turns with the second link."""

    only, needs, start = "mass-spring", frozenset({"mass-spring"}), 0.02

    def shape(self, rng: Generator) -> None:
        way = rng.uniform(0, 2 * np.pi)
        self.arm = np.array([np.cos(way), np.sin(way)])

    def load_force(self, m: Motion, force: Array) -> Array:
        # first moment in kg m; the moment about the end point itself is left to the bearing there
        r = m.turned("link2", 0.0, np.broadcast_to(self.amount * self.arm, force.shape), back=True)
        return -(m.accel[:, 1:] * np.column_stack([-r[:, 1], r[:, 0]]) - m.omega[:, 1:] ** 2 * r)


ALL: list[type[LoadEffect]] = [
    Tremor, Breathing, Startle, HelpsAlong, Anticipates, WobblingTissue, HandSlips, StressRelaxes, LoadDrag,
    TwoSidedStiffness, PayloadRubs, SpringsRattle, PayloadTurns,
]  # fmt: skip
