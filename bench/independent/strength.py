"""How large an effect is, in units of the noise, and how its amount is set.

The footprint is what an effect adds to the residuals of ``residual`` (below 10 Hz, true parameters, the same
motion with and without). Its root mean square over the trials in which the effect acts, divided by that of the
noise in the same channel, in the channel where this is largest, is the strength:

    raw    the footprint as it is
    seen   after the papers' own parameters (alpha, each load's M, B, K, x0, a weighed mass excepted) have
           been regressed out, with all trials at once: what is left for anyone to find

A gain that the inertias absorb has a large raw strength and a small seen one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import residual as res
from .chain import signals
from .declared import declared
from .effects import Effect
from .instruments import record
from .mechanics import Array
from .motion import Motion

EVERY_ROW = 4  # 25 Hz are enough for the regression: the band ends at 10 Hz


@dataclass(frozen=True)
class Sizes:
    raw: float
    seen: float


def noise_of(motions: tuple[Motion, ...]) -> Array:
    """Root mean square of the noise in the four channels, the force sensor's over load trials."""
    squares, counts = np.zeros(4), np.zeros(4)
    for m in motions:
        rows = record(m, signals(m, ()), m.laboratory.instruments)
        seen = res.channel_noise(m, res.noise_seen(m, rows))
        both = np.column_stack([seen["tau"], seen["sensor"]])
        weight = np.array([1, 1, m.loaded, m.loaded], dtype=float)
        squares += weight * (both**2).sum(0)
        counts += weight * both.shape[0]
    return np.sqrt(squares / np.maximum(counts, 1))


class Ruler:
    """Measures footprints on given motions."""

    def __init__(self, motions: tuple[Motion, ...], noise: Array | None = None) -> None:
        self.motions, self.lab = motions, motions[0].laboratory
        self.noise = noise_of(motions) if noise is None else noise
        used = self.noise > 0
        self.weight = np.where(used, 1 / np.where(used, self.noise, 1), 0.0)
        self.clean, alpha, loads = [], [], []
        for m in motions:
            seen = res.analyst(m, signals(m, ()), self.lab.robot.lengths)
            self.clean.append(res.residual(m, seen))
            thin = res.thinned(seen, EVERY_ROW)
            alpha.append(self._weighted(m, res.alpha_columns(thin)))
            loads.append(self._weighted(m, res.load_columns(m.load, thin)) if m.load else None)
        self._ends = np.cumsum([a.shape[0] for a in alpha])[:-1]
        # a load's columns are zero outside its own trials: take them out first, alpha of what they leave (Frisch-Waugh)
        self._groups = []
        for name in sorted({m.load.name for m in motions if m.load}):
            own = [i for i, m in enumerate(motions) if m.load and m.load.name == name]
            base = _orthonormal(np.concatenate([c for i in own if (c := loads[i]) is not None]))
            self._groups.append((own, base))
        self._alpha = _orthonormal(np.concatenate(self._without_loads(alpha)))

    def _weighted(self, m: Motion, columns: Array) -> Array:
        return (columns * self._weight(m)[None, :, None]).reshape(-1, columns.shape[2])

    def _weight(self, m: Motion) -> Array:
        return np.asarray(self.weight * np.array([1, 1, m.loaded, m.loaded]))

    def _without_loads(self, rows: list[Array]) -> list[Array]:
        """Each trial's rows, (rows, any), less what its load's parameters can take."""
        out = list(rows)
        for own, base in self._groups:
            stacked = np.concatenate([rows[i] for i in own])
            left = stacked - base @ (base.T @ stacked)
            parts = np.split(left, np.cumsum([rows[i].shape[0] for i in own])[:-1])
            for i, part in zip(own, parts, strict=True):
                out[i] = part
        return out

    def _regressed(self, prints: list[Array]) -> list[Array]:
        y = np.concatenate(self._without_loads([p[::EVERY_ROW].reshape(-1, 1) for p in prints]))
        left = y - self._alpha @ (self._alpha.T @ y)
        return [part.reshape(-1, 4) for part in np.split(left, self._ends)]

    def sizes(self, effects: tuple[Effect, ...]) -> Sizes:
        """Strengths of the effects together."""
        setup = declared(self.lab)
        for effect in effects:
            effect.declare(setup)
        lengths = tuple(setup["robot"]["link_lengths_m"])
        prints, acting = [], [any(e.acts(m) for e in effects) for m in self.motions]
        for m, clean, acts in zip(self.motions, self.clean, acting, strict=True):
            if acts:
                part = res.residual(m, res.analyst(m, signals(m, effects), lengths)) - clean
                prints.append(part * self._weight(m))
            else:
                prints.append(np.zeros_like(clean))
        return Sizes(self._largest(prints, acting), self._largest(self._regressed(prints), acting))

    def _largest(self, prints: list[Array], acting: list[bool]) -> float:
        loads = [m.loaded for m in self.motions]
        torque = np.concatenate([p[:, :2] for p, a in zip(prints, acting, strict=True) if a])
        force = [p[:, 2:] for p, a, loaded in zip(prints, acting, loads, strict=True) if a and loaded]
        both = [torque, np.concatenate(force)] if force else [torque]
        return float(max(np.sqrt((b**2).mean(0)).max() for b in both))


def _orthonormal(columns: Array) -> Array:
    """An orthonormal base of the columns' span; directions below 1e-5 of the largest are left out."""
    sizes = np.sqrt((columns**2).sum(0))
    scaled = columns[:, sizes > 0] / sizes[sizes > 0]
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    keep = values > 1e-10 * values[-1]
    return np.asarray(scaled @ (vectors[:, keep] / np.sqrt(values[keep])))


def calibrate(ruler: Ruler, effect: Effect, target: float, measure: str) -> None:
    """Set the effect's amount for the wanted strength, by a few steps of the secant in logarithms, within what
    nature allows (``most``)."""
    effect.amount = effect.start
    got = getattr(ruler.sizes((effect,)), measure)
    slope = 1.0
    for _ in range(6):
        if abs(np.log(got / target)) < 0.04 or (effect.amount >= effect.most and got < target):
            break
        before, had = effect.amount, got
        wanted = before * float(np.clip((target / had) ** (1 / slope), 0.02, 50))
        effect.amount = min(wanted, effect.most)
        got = getattr(ruler.sizes((effect,)), measure)
        moved = np.log(effect.amount / before)
        if abs(moved) > 1e-9:
            slope = float(np.clip(np.log(got / had) / moved, 0.3, 3))
