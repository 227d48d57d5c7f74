"""What every effect is: where it acts in the chain from the motors to the files.

    joints' motion ── load_force ──> force of the load on the robot ── sensed ──> fx, fy
          │                                   │
          │                        torque of the motors = inverse dynamics - Jᵀ F + reaction
          │                                                        └── drive ──> tau1, tau2
          ├── angle ──> enc1, enc2, theta1, theta2
          └── felt ──> ax, ay

An effect overrides what it touches, and draws its places and shape at random when it is made; ``amount``
alone is set afterwards, so that its footprint has the wanted size. All arrays are (n, 2) on the fine grid.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from ..laboratory import Laboratory
from ..mechanics import Array, Load
from ..motion import Motion

JOINTS = ("joint1", "joint2")
Declared = dict[str, dict[str, Any]]


class Effect:
    """One hidden effect. ``name`` is the catalogue's, None for an effect that has no name there; ``near`` are
    names whose equation covers part of an unnamed one (reported apart from right and wrong); ``with_`` are names
    that the effect's own equation contains, so that reporting them beside it is no mistake.
    """

    name: ClassVar[str | None] = None
    near: ClassVar[tuple[str, ...]] = ()
    with_: ClassVar[tuple[str, ...]] = ()
    instead: ClassVar[tuple[tuple[str, ...], ...]] = ()  # other names whose equations together are the same
    any_joint: ClassVar[bool] = False  # one equation for both joints, so either place says it
    needs: ClassVar[frozenset[str]] = frozenset()
    whens: ClassVar[tuple[str, ...]] = ("all",)
    K_defined: ClassVar[bool] = True  # whether the load still has one K that an interval can hold
    start: ClassVar[float] = 1.0  # an amount to begin the search with
    most: ClassVar[float] = 1e9  # an amount beyond which nature does not go

    def __init__(self, rng: Generator, lab: Laboratory) -> None:
        self.rng, self.lab, self.amount = rng, lab, self.start
        self.where: list[str] = ["tip"]
        self.when = str(rng.choice(self.whens))
        self.salt = int(rng.integers(1 << 30))
        self.draw(rng)

    @classmethod
    def key(cls) -> str:
        """SoftTransmission is asked for as soft_transmission."""
        return "".join("_" + c.lower() if c.isupper() else c for c in cls.__name__).lstrip("_")

    def draw(self, rng: Generator) -> None:
        """Places and shape."""

    def acts(self, m: Motion) -> bool:
        return self.when == "all" or (self.when == "load") == m.loaded

    def reaction(self, m: Motion, tau: Array) -> Array | float:
        """Torque that the motors must deliver beside ``tau`` (what they deliver without this effect)."""
        return 0.0

    def load_force(self, m: Motion, force: Array) -> Array | float:
        """Force on the robot beside that of the load's model; asked for in load trials only."""
        return 0.0

    def drive(self, m: Motion, tau: Array) -> Array:
        """What is logged where the motors deliver ``tau``."""
        return tau

    def felt(self, m: Motion, f: Array, tau: Array) -> Array:
        """Specific force along the sensor's axes, m/s²."""
        return f

    def angle(self, m: Motion, theta: Array, tau: Array) -> Array:
        """Angle that the encoders see."""
        return theta

    def sensed(self, m: Motion, force: Array) -> Array:
        """Reading of the force sensor along its own axes, N."""
        return force

    def clock(self, m: Motion, t: Array) -> Array:
        """Error of the robot's time at ``t``, s."""
        return np.zeros_like(t)

    def stiffness(self, load: Load) -> Array | float:
        """What the effect adds to the stiffness of a load for good, N/m."""
        return 0.0

    def declare(self, setup: Declared) -> None:
        """Change what setup.toml says."""

    def parameters(self) -> dict[str, Any]:
        return {"amount": self.amount}

    # shared by many
    def pick_joints(self, rng: Generator, both: float = 0.3) -> None:
        chosen = [0, 1] if rng.random() < both else [int(rng.integers(2))]
        self.where = [JOINTS[j] for j in chosen]
        self.mask: Array = np.array([float(j in chosen) for j in range(2)])
        self.shares: Array = self.mask * np.array([1.0, rng.uniform(0.5, 1.6)])
        if chosen == [1]:
            self.shares = self.mask

    def pick_axes(self, rng: Generator, both: float = 0.5) -> None:
        chosen = [0, 1] if rng.random() < both else [int(rng.integers(2))]
        self.where = ["xy"[j] for j in chosen]
        signs = rng.choice([-1.0, 1.0], 2) * rng.uniform(0.5, 1.0, 2)
        self.shares = np.array([signs[j] * (j in chosen) for j in range(2)])

    def per_joint(self, values: Iterable[float]) -> dict[str, float]:
        return {j: float(v) for j, v in zip(JOINTS, values, strict=True) if j in self.where}


def turn(angle: float) -> Array:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def sign(omega: Array, width: float = 0.003) -> Array:
    """Direction of motion; creeping below ``width`` rad/s, as greased contacts do."""
    return np.tanh(omega / width)


COARSE = 4  # memory is worked out on every fourth instant (250 Hz)


def _spread(coarse: Array, n: int) -> Array:
    return np.interp(np.arange(n), np.arange(coarse.size) * COARSE, coarse)


def play(x: Array, half: float) -> Array:
    """Play of half width ``half``: what is dragged along; (n,)."""
    raw, out = x[::COARSE].tolist(), []
    z = raw[0]
    for value in raw:
        z = min(max(z, value - half), value + half)
        out.append(z)
    return _spread(np.array(out), x.size)


def slip(x: Array, width: float, exponent: float = 1.0) -> Array:
    """Dahl's spring that slides, between -1 and 1; dz/dx = (1 - z sign(dx))^exponent / width; (n,)."""
    steps = (np.diff(x[::COARSE], prepend=x[0]) / width).tolist()
    out, z = [], 0.0
    for dx in steps:
        s = 1.0 if dx > 0 else -1.0
        d = abs(dx)
        parts = int(d / 0.2) + 1
        for _ in range(min(parts, 25)):
            z += s * (d / parts) * max(1 - s * z, 0.0) ** exponent
        z = min(max(z, -1.0), 1.0)
        out.append(z)
    return _spread(np.array(out), x.size)


def first_order(values: Array, lag: float, rate: float = 1000.0) -> Array:
    """Lag with the given time constant, in rest at the first value."""

    fade = np.exp(-1 / (lag * rate))
    return np.asarray(lfilter([1 - fade], [1, -fade], values - values[0], axis=0) + values[0])


def shifted(values: Array, delay: float | Array, t: Array) -> Array:
    """values at t - delay; the ends are held."""
    return np.column_stack([np.interp(t - delay, t, values[:, j]) for j in range(values.shape[1])])
