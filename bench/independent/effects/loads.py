"""Effects of the load that have a name in the catalogue. ``m.load`` is never None where these are asked."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator

from ..mechanics import Array, Load
from ..motion import Motion
from .base import Effect, shifted, slip, turn


def the_load(m: Motion) -> Load:
    assert m.load is not None
    return m.load


class LoadEffect(Effect):
    whens = ("load",)
    only: str | None = None  # "arm" or "mass-spring"

    def draw(self, rng: Generator) -> None:
        self.where = ["load"]
        self.shape(rng)

    def shape(self, rng: Generator) -> None:
        """What is random beside the place."""

    def acts(self, m: Motion) -> bool:
        return m.load is not None and self.only in (None, m.load.kind)


class SpringsDamped(LoadEffect):
    name, only, needs, start = "load.damping", "mass-spring", frozenset({"mass-spring"}), 1.0

    def shape(self, rng: Generator) -> None:
        axes = turn(float(rng.uniform(0, np.pi)))
        self.B = axes @ np.diag([1.0, rng.uniform(0.2, 1.0)]) @ axes.T

    def load_force(self, m: Motion, force: Array) -> Array:
        return -self.amount * m.v @ self.B.T

    def parameters(self) -> dict[str, Any]:
        return {"B": (self.amount * self.B).tolist()}


class HardeningSprings(LoadEffect):
    """Force along the displacement that grows with its cube."""

    name, start = "load.stiffness_cubic", 2e4

    def shape(self, rng: Generator) -> None:
        self.way = float(rng.choice([1, -1], p=[0.7, 0.3]))

    def load_force(self, m: Motion, force: Array) -> Array:
        d = m.x - the_load(m).x0
        return np.asarray(-self.way * self.amount * (d**2).sum(1, keepdims=True) * d)

    def parameters(self) -> dict[str, Any]:
        return {"cubic": self.way * self.amount}


class LoadHysteresis(LoadEffect):
    name, start, K_defined = "load.hysteresis", 0.3, False

    def shape(self, rng: Generator) -> None:
        self.width, self.shares = float(rng.uniform(0.002, 0.01)), rng.uniform(0.4, 1.0, 2)

    def load_force(self, m: Motion, force: Array) -> Array:
        return -self.amount * self.shares * np.column_stack([slip(m.x[:, j], self.width) for j in range(2)])

    def parameters(self) -> dict[str, Any]:
        return {"amplitude": (self.amount * self.shares).tolist(), "width": self.width}


class LoadPlay(LoadEffect):
    """The springs take hold only beyond a play around their rest."""

    name, start, most = "load.deadzone", 1e-3, 0.02

    def load_force(self, m: Motion, force: Array) -> Array:
        load = the_load(m)
        return np.clip(m.x - load.x0, -self.amount, self.amount) @ load.K.T

    def parameters(self) -> dict[str, Any]:
        return {"width": self.amount}


class Reflex(LoadEffect):
    """Stretch reflex: stiffness and damping that answer 30 to 90 ms late."""

    name, only, needs, start = "load.delay", "arm", frozenset({"arm"}), 10.0
    most, K_defined = 300.0, False

    def shape(self, rng: Generator) -> None:
        self.delay = float(rng.uniform(0.03, 0.09))
        self.k, self.b = rng.uniform(0.5, 1.0, 2), rng.uniform(0.02, 0.06)

    def load_force(self, m: Motion, force: Array) -> Array:
        answer = self.k * (m.x - the_load(m).x0) + self.b * m.v
        return -self.amount * shifted(answer, self.delay, m.t)

    def parameters(self) -> dict[str, Any]:
        gain = self.amount * self.k
        return {"delay": self.delay, "gain_k": gain.tolist(), "gain_b": self.amount * self.b}


class EquilibriumRamps(LoadEffect):
    """The place of rest wanders off, in another direction in each trial; ``amount`` is its speed."""

    name, start, most = "load.drift", 1e-4, 5e-3

    def load_force(self, m: Motion, force: Array) -> Array:
        way = m.rng(self.salt).uniform(0, 2 * np.pi)
        rate = self.amount * np.array([np.cos(way), np.sin(way)])
        return np.clip(m.t, 0, None)[:, None] * (the_load(m).K @ rate)

    def parameters(self) -> dict[str, Any]:
        return {"rate": self.amount}


class SkewSprings(LoadEffect):
    """A lever among the springs: K is not symmetric."""

    name, only, needs, start = "load.coupling", "mass-spring", frozenset({"mass-spring"}), 10.0

    def shape(self, rng: Generator) -> None:
        self.dK = rng.choice([-1, 1]) * np.array([[0.0, 1.0], [-rng.uniform(0, 1), 0.0]])

    def stiffness(self, load: Load) -> Array:
        return self.amount * self.dK if load.kind == "mass-spring" else np.zeros((2, 2))

    def load_force(self, m: Motion, force: Array) -> Array:
        return np.asarray(-self.amount * (m.x - the_load(m).x0) @ self.dK.T)

    def parameters(self) -> dict[str, Any]:
        return {"K": (self.amount * self.dK).tolist()}


class GuidedPayload(LoadEffect):
    """The payload hangs on a linkage: its M is no multiple of one."""

    name, only, needs, start = "load.coupling", "mass-spring", frozenset({"mass-spring"}), 0.05

    def shape(self, rng: Generator) -> None:
        axes = turn(float(rng.uniform(0, np.pi)))
        self.dM = axes @ np.diag([1.0, 0.0]) @ axes.T

    def load_force(self, m: Motion, force: Array) -> Array:
        return -self.amount * m.a @ self.dM.T

    def parameters(self) -> dict[str, Any]:
        return {"M": (self.amount * self.dM).tolist()}


class StiffnessChanges(LoadEffect):
    """K rises or falls through each trial: as a ramp, a step, or a slow wave; its matrix keeps its shape."""

    name, start, most, K_defined = "load.time_varying", 0.05, 0.8, False

    def shape(self, rng: Generator) -> None:
        self.form, self.way = str(rng.choice(["ramp", "step", "wave"])), float(rng.choice([-1, 1]))

    def course(self, m: Motion) -> Array:
        u = m.share
        if self.form == "ramp":
            return u - 0.5
        if self.form == "step":
            at = m.rng(self.salt).uniform(0.35, 0.65)
            return np.tanh((u - at) * m.plan.duration / 0.3) / 2
        return 0.5 * np.sin(2 * np.pi * u + m.rng(self.salt).uniform(0, 2 * np.pi))

    def load_force(self, m: Motion, force: Array) -> Array:
        load = the_load(m)
        return -self.way * self.amount * self.course(m)[:, None] * ((m.x - load.x0) @ load.K.T)

    def parameters(self) -> dict[str, Any]:
        return {"form": self.form, "relative_change": self.way * self.amount}


class GripChanges(StiffnessChanges):
    """The subject grips harder once in a trial: B and K step up together."""

    only, needs = "arm", frozenset({"arm"})

    def shape(self, rng: Generator) -> None:
        self.form, self.way = "step", 1.0

    def load_force(self, m: Motion, force: Array) -> Array:
        load = the_load(m)
        passive = (m.x - load.x0) @ load.K.T + m.v @ load.B.T
        return -self.amount * self.course(m)[:, None] * passive


class Fatigue(StiffnessChanges):
    """B and K of the arm decay together with a time constant of about the trial's length."""

    only, needs = "arm", frozenset({"arm"})

    def shape(self, rng: Generator) -> None:
        self.form, self.way = "decay", -1.0

    def load_force(self, m: Motion, force: Array) -> Array:
        load = the_load(m)
        passive = (m.x - load.x0) @ load.K.T + m.v @ load.B.T
        return self.amount * (1 - np.exp(-1.5 * m.share))[:, None] * passive


ALL: list[type[Effect]] = [
    SpringsDamped, HardeningSprings, LoadHysteresis, LoadPlay, Reflex, EquilibriumRamps, SkewSprings, GuidedPayload,
    StiffnessChanges, GripChanges, Fatigue,
]  # fmt: skip
