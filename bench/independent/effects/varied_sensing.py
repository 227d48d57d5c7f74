"""Effects with a name of the catalogue in forms that the first book does not have: instruments and loads."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator

from ..mechanics import Array
from ..motion import Motion
from .base import Effect, shifted, slip
from .loads import HardeningSprings, LoadEffect, LoadPlay, Reflex, SpringsDamped, the_load
from .sensing import EncoderZero, ForceGain, ForceZero, LinkLength, SensorGain, SensorTurned, SensorZero
from .varied import by_trial

MASS_SPRING = frozenset({"mass-spring"})


class SensorTurnedForLoads(SensorTurned):
    """The accelerometer was taken off and glued on again, askew, before the loads."""

    whens = ("load",)


class SensorGainInFreeTrials(SensorGain):
    """The supply of the accelerometer was changed after the free trials."""

    whens = ("free",)


class SensorZeroByTrial(SensorZero):
    """The accelerometer's zero is another after each start."""

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return f + self.amount * self.shares * by_trial(m, self.salt, 0.4, 1.5)


class SensorEarly(Effect):
    """A filter's delay was taken off twice: the accelerometer is early."""

    name, start, most = "accel.delay", 0.003, 0.06

    def draw(self, rng: Generator) -> None:
        self.where = ["sensor"]

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return shifted(f, -self.amount, m.t)

    def parameters(self) -> dict[str, Any]:
        return {"delay": -self.amount}


class HomedAgainForLoads(EncoderZero):
    """One joint was homed again between the free trials and the loads, to a zero that is off."""

    whens = ("load",)

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)


class LengthsTraded(LinkLength):
    """Both declared lengths are wrong and their sum is right: the elbow was measured at the wrong screw."""

    def draw(self, rng: Generator) -> None:
        self.where = ["joint1", "joint2"]
        self.shares = np.array([1.0, -1.0]) * rng.choice([-1, 1])


class ClockOffInOneTrial(Effect):
    """The robot's clock is bent in one trial only: its rate changes once, in the middle."""

    name, start, most = "clock.drift", 0.003, 0.1

    def draw(self, rng: Generator) -> None:
        self.where, self.which = ["sensor"], int(rng.integers(len(self.lab.plans)))

    def acts(self, m: Motion) -> bool:
        return m.index == self.which

    def clock(self, m: Motion, t: Array) -> Array:
        return self.amount * np.clip(t / m.plan.duration - 0.5, 0, None) * 2

    def parameters(self) -> dict[str, Any]:
        return {"seconds": self.amount, "trial": self.lab.plans[self.which].folder}


class ForceGainAtArm(ForceGain):
    """The force sensor's amplifier was switched to another range for the arm."""

    whens, needs = ("load",), frozenset({"force_sensor", "arm", "mass-spring"})

    def acts(self, m: Motion) -> bool:
        return m.load is not None and m.load.kind == "arm"


class ForceZeroByTrial(ForceZero):
    """The force sensor is zeroed before each trial, with something leaning on it."""

    def sensed(self, m: Motion, force: Array) -> Array:
        return force + self.amount * self.shares * by_trial(m, self.salt, 0.4, 1.5)


class ForceEarly(Effect):
    """The force sensor's filter delay was taken off twice: it is early."""

    name, needs, start, most = "force.delay", frozenset({"force_sensor"}), 0.003, 0.06

    def draw(self, rng: Generator) -> None:
        self.where = ["sensor"]

    def sensed(self, m: Motion, force: Array) -> Array:
        return shifted(force, -self.amount, m.t)

    def parameters(self) -> dict[str, Any]:
        return {"delay": -self.amount}


class OneArrayDamped(SpringsDamped):
    """Foam in one spring array only: that load is damped and the others are not."""

    def shape(self, rng: Generator) -> None:
        super().shape(rng)
        names = sorted({p.load.name for p in self.lab.plans if p.load and p.load.kind == "mass-spring"})
        self.which = str(rng.choice(names))

    def acts(self, m: Motion) -> bool:
        return m.load is not None and m.load.name == self.which

    def parameters(self) -> dict[str, Any]:
        return super().parameters() | {"load": self.which}


class HardensAlongOneLine(HardeningSprings):
    """One spring of the array hardens or softens: a cubic force along its own line."""

    only, needs = "mass-spring", MASS_SPRING

    def shape(self, rng: Generator) -> None:
        super().shape(rng)
        way = rng.uniform(0, np.pi)
        self.line = np.array([np.cos(way), np.sin(way)])

    def load_force(self, m: Motion, force: Array) -> Array:
        along = (m.x - the_load(m).x0) @ self.line
        return -self.way * self.amount * np.outer(along**3, self.line)


class PlayInOneSpring(LoadPlay):
    """One hook of the springs has play: along one axis of the stiffness only."""

    only, needs = "mass-spring", MASS_SPRING

    def load_force(self, m: Motion, force: Array) -> Array:
        load = the_load(m)
        stiffness, axes = np.linalg.eigh(load.K)
        along = np.clip((m.x - load.x0) @ axes[:, 1], -self.amount, self.amount)
        return np.asarray(stiffness[1] * np.outer(along, axes[:, 1]))


class GripHysteresis(LoadEffect):
    """The arm's hand in its glove: a loop in both directions, in arm trials only."""

    name, start, K_defined = "load.hysteresis", 0.3, False
    only, needs = "arm", frozenset({"arm"})

    def shape(self, rng: Generator) -> None:
        self.width = float(rng.uniform(0.003, 0.012))

    def load_force(self, m: Motion, force: Array) -> Array:
        return -self.amount * np.column_stack([slip(m.x[:, j], self.width) for j in range(2)])

    def parameters(self) -> dict[str, Any]:
        return {"amplitude": self.amount, "width": self.width}


class LongLoopReflex(Reflex):
    """A long-loop reflex: damping alone, after a tenth of a second or more."""

    def shape(self, rng: Generator) -> None:
        self.delay, self.k = float(rng.uniform(0.09, 0.14)), np.zeros(2)
        self.b = float(rng.uniform(0.04, 0.08))


class PostureShifts(LoadEffect):
    """The subject shifts once in each trial: the place of rest moves to another within two seconds."""

    name, start, most = "load.drift", 1e-3, 0.05
    only, needs = "arm", frozenset({"arm"})

    def load_force(self, m: Motion, force: Array) -> Array:
        rng = m.rng(self.salt)
        way, at = rng.uniform(0, 2 * np.pi), rng.uniform(0.25, 0.75) * m.plan.duration
        u = np.clip((m.t - at) / 2.0 + 0.5, 0, 1)
        moved = self.amount * (u**3 * (10 - 15 * u + 6 * u**2))
        return np.outer(moved, the_load(m).K @ np.array([np.cos(way), np.sin(way)]))

    def parameters(self) -> dict[str, Any]:
        return {"metres": self.amount}


class StiffnessSwitches(LoadEffect):
    """The subject tenses and relaxes by turns: K has two values and jumps between them at random."""

    name, start, most, K_defined = "load.time_varying", 0.05, 0.8, False
    only, needs = "arm", frozenset({"arm"})

    def load_force(self, m: Motion, force: Array) -> Array:
        load, rng = the_load(m), m.rng(self.salt)
        edges = np.cumsum(rng.uniform(2, 7, 60)) - rng.uniform(0, 4)
        tense = np.searchsorted(edges, m.t) % 2 - 0.5
        return -self.amount * tense[:, None] * ((m.x - load.x0) @ load.K.T)

    def parameters(self) -> dict[str, Any]:
        return {"form": "switches", "relative_change": self.amount}


class SandRunsOut(LoadEffect):
    """The payload is a bag of sand with a hole: its mass falls through each trial (it is filled between them)."""

    name, start, most = "load.time_varying", 0.05, 0.7
    only, needs = "mass-spring", MASS_SPRING

    def load_force(self, m: Motion, force: Array) -> Array:
        return self.amount * (m.share - 0.5)[:, None] * (m.a @ the_load(m).M.T)

    def parameters(self) -> dict[str, Any]:
        return {"form": "ramp of M", "relative_change": -self.amount}


ALL: list[type[Effect]] = [
    SensorTurnedForLoads, SensorGainInFreeTrials, SensorZeroByTrial, SensorEarly, HomedAgainForLoads, LengthsTraded,
    ClockOffInOneTrial, ForceGainAtArm, ForceZeroByTrial, ForceEarly, OneArrayDamped, HardensAlongOneLine,
    PlayInOneSpring, GripHysteresis, LongLoopReflex, PostureShifts, StiffnessSwitches, SandRunsOut,
]  # fmt: skip
