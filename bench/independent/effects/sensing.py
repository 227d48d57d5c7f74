"""Effects of the instruments that have a name in the catalogue."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator

from ..mechanics import Array
from ..motion import Motion
from .base import Declared, Effect, shifted, turn


class SensorTurned(Effect):
    name, start, most = "accel.misalignment", 0.02, 0.5

    def draw(self, rng: Generator) -> None:
        self.where, self.way = ["sensor"], float(rng.choice([-1, 1]))

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return f @ turn(self.way * self.amount)

    def parameters(self) -> dict[str, Any]:
        return {"angle_rad": self.way * self.amount}


class SensorGain(Effect):
    name, start, most = "accel.scale", 0.02, 0.5

    def draw(self, rng: Generator) -> None:
        self.pick_axes(rng)

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return f * (1 + self.amount * self.shares)

    def parameters(self) -> dict[str, Any]:
        return {"gain": (1 + self.amount * self.shares).tolist()}


class SensorZero(Effect):
    name, start, most = "accel.bias", 0.05, 3.0

    def draw(self, rng: Generator) -> None:
        self.pick_axes(rng)

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return f + self.amount * self.shares

    def parameters(self) -> dict[str, Any]:
        return {"bias": (self.amount * self.shares).tolist()}


class SensorCross(Effect):
    """Each axis hears a share of the other, not the same share."""

    name, start, most = "accel.cross_axis", 0.02, 0.4

    def draw(self, rng: Generator) -> None:
        self.pick_axes(rng)

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return f + self.amount * self.shares * f[:, ::-1]

    def parameters(self) -> dict[str, Any]:
        return {"cross": (self.amount * self.shares).tolist()}


class SensorLate(Effect):
    name, start, most = "accel.delay", 0.003, 0.06

    def draw(self, rng: Generator) -> None:
        self.where = ["sensor"]

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        return shifted(f, self.amount, m.t)

    def parameters(self) -> dict[str, Any]:
        return {"delay": self.amount}


class SensorAway(Effect):
    """The accelerometer sits beside the end point, on the turning end-effector."""

    name, start, most = "accel.lever_arm", 0.01, 0.12

    def draw(self, rng: Generator) -> None:
        self.where, way = ["sensor"], rng.uniform(0, 2 * np.pi)
        self.arm = np.array([np.cos(way), np.sin(way)])

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        ins = self.lab.instruments
        r = m.turned("link2", 0.0, np.broadcast_to(self.amount * self.arm, f.shape), back=True)
        extra = m.accel[:, 1:] * np.column_stack([-r[:, 1], r[:, 0]]) - m.omega[:, 1:] ** 2 * r
        return f + m.turned(ins.mount, ins.mount_angle, extra)

    def parameters(self) -> dict[str, Any]:
        return {"lever": (self.amount * self.arm).tolist()}


class EncoderOffCentre(Effect):
    name, start, most = "encoder.eccentricity", 0.003, 0.15

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.2)
        self.phase = rng.uniform(0, 2 * np.pi, 2)

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        return theta + self.amount * self.shares * np.sin(theta + self.phase)

    def parameters(self) -> dict[str, Any]:
        amplitude = self.per_joint(self.amount * self.shares)
        return {"amplitude_rad": amplitude, "phase_rad": self.per_joint(self.phase)}


class EncoderZero(Effect):
    name, start, most = "encoder.zero", 0.01, 0.4

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.2)
        self.shares = self.shares * rng.choice([-1, 1], 2)

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        return theta + self.amount * self.shares

    def parameters(self) -> dict[str, Any]:
        return {"zero_rad": self.per_joint(self.amount * self.shares)}


class EncoderCounts(Effect):
    """Declared counts per turn are wrong, so all angles from the zero on are off by a factor."""

    name, start, most = "encoder.scale", 0.01, 0.3

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.2)
        self.shares = self.shares * rng.choice([-1, 1], 2)

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        zero = np.array(self.lab.instruments.zero)
        return np.asarray(zero + (theta - zero) / (1 + self.amount * self.shares))

    def parameters(self) -> dict[str, Any]:
        return {"factor": self.per_joint(1 + self.amount * self.shares)}


class LinkLength(Effect):
    name, start, most = "geometry.link_length", 0.005, 0.08

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0.2)
        self.shares = self.shares * rng.choice([-1, 1], 2)

    def declare(self, setup: Declared) -> None:
        said = [v + self.amount * s for v, s in zip(self.lab.robot.lengths, self.shares, strict=True)]
        setup["robot"]["link_lengths_m"] = [round(v, 6) for v in said]

    def parameters(self) -> dict[str, Any]:
        return {
            "length_m": list(self.lab.robot.lengths),
            "declared_off_by": (self.amount * self.shares).tolist(),
        }


class ClockWander(Effect):
    """The robot's clock breathes slowly, with another phase and period in each trial."""

    name, start, most = "clock.drift", 0.002, 0.1

    def draw(self, rng: Generator) -> None:
        self.where = ["sensor"]

    def clock(self, m: Motion, t: Array) -> Array:
        rng = m.rng(self.salt)
        cycles, phase = rng.uniform(0.5, 2.0), rng.uniform(0, 2 * np.pi)
        return self.amount * np.sin(2 * np.pi * cycles * t / m.plan.duration + phase)

    def parameters(self) -> dict[str, Any]:
        return {"seconds": self.amount}


class ClockAging(Effect):
    """The robot's clock changes its rate through each trial, up in some and down in others."""

    name, start, most = "clock.drift", 0.002, 0.1

    def draw(self, rng: Generator) -> None:
        self.where = ["sensor"]

    def clock(self, m: Motion, t: Array) -> Array:
        u = t / m.plan.duration
        return self.amount * m.rng(self.salt).uniform(-1, 1) * 4 * u * (1 - u)

    def parameters(self) -> dict[str, Any]:
        return {"seconds": self.amount}


class _Force(Effect):
    needs = frozenset({"force_sensor"})

    def draw(self, rng: Generator) -> None:
        self.pick_axes(rng)
        self.places = self.where
        self.where = ["sensor"]


class ForceGain(_Force):
    name, start, most = "force.scale", 0.02, 0.5

    def sensed(self, m: Motion, force: Array) -> Array:
        return force * (1 + self.amount * self.shares)

    def parameters(self) -> dict[str, Any]:
        return {"gain": (1 + self.amount * self.shares).tolist()}


class ForceTurned(_Force):
    name, start, most = "force.misalignment", 0.02, 0.5

    def sensed(self, m: Motion, force: Array) -> Array:
        return force @ turn(self.amount)

    def parameters(self) -> dict[str, Any]:
        return {"angle_rad": self.amount}


class ForceCross(_Force):
    name, start, most = "force.cross_axis", 0.02, 0.4

    def sensed(self, m: Motion, force: Array) -> Array:
        return force + self.amount * self.shares * force[:, ::-1]

    def parameters(self) -> dict[str, Any]:
        return {"cross": (self.amount * self.shares).tolist()}


class ForceZero(_Force):
    name, start, most = "force.bias", 0.1, 20.0

    def sensed(self, m: Motion, force: Array) -> Array:
        return force + self.amount * self.shares

    def parameters(self) -> dict[str, Any]:
        return {"bias": (self.amount * self.shares).tolist()}


class ForceDrift(_Force):
    """Zeroed before each trial, then drifts; ``amount`` is the drift over the longest trial."""

    name, start, most = "force.bias", 0.2, 20.0

    def _rate(self) -> Array:
        return self.amount * self.shares / max(p.duration for p in self.lab.plans)

    def sensed(self, m: Motion, force: Array) -> Array:
        return force + np.clip(m.t, 0, None)[:, None] * self._rate()

    def parameters(self) -> dict[str, Any]:
        return {"drift": self._rate().tolist()}


class ForceLate(_Force):
    name, start, most = "force.delay", 0.003, 0.06

    def sensed(self, m: Motion, force: Array) -> Array:
        return shifted(force, self.amount, m.t)

    def parameters(self) -> dict[str, Any]:
        return {"delay": self.amount}


ALL: list[type[Effect]] = [
    SensorTurned, SensorGain, SensorZero, SensorCross, SensorLate, SensorAway, EncoderOffCentre, EncoderZero,
    EncoderCounts, LinkLength, ClockWander, ClockAging, ForceGain, ForceTurned, ForceCross, ForceZero, ForceDrift,
    ForceLate,
]  # fmt: skip
