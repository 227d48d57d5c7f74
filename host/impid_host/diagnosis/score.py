"""How well an explanation (a set of terms) predicts blocks that took no part in fitting it.

For each block of two seconds the base model and the terms are fitted to all rows but that block and its
neighbours, and the block's log predictive density is taken, all channels together. Two explanations are
compared by the sum of the differences over the blocks and its standard error (Vehtari, Gelman and Gabry,
Statistics and Computing 27, 2017).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impid_host.diagnosis.noise import log_density
from impid_host.diagnosis.rows import REFERENCE
from impid_host.diagnosis.table import Table, unit_grams
from impid_host.signals.arrays import Floats

_RIDGE = 1e-9


@dataclass(frozen=True, slots=True)
class Explanation:
    """A set of terms, and how well it predicts.

    Attributes:
        slots: of the table, in the order in which they were added.
        density: log predictive density of each block of time, (B,), nats.
        reference: the same of the references (weighed payloads, an earlier robot), all together.
        beta: of the terms, fitted to all rows, (k,).
    """

    slots: tuple[int, ...]
    density: Floats
    reference: float
    beta: Floats

    @property
    def total(self) -> float:
        """Sum over all blocks and the references."""
        return float(np.sum(self.density)) + self.reference


@dataclass(frozen=True, slots=True)
class Difference:
    """By how much one explanation predicts better than another, nats, and its standard error."""

    gain: float
    se: float

    @property
    def sigmas(self) -> float:
        """Gain in standard errors."""
        return self.gain / max(self.se, 1e-9)


def difference(one: Explanation, other: Explanation) -> Difference:
    """Positive where `one` predicts better. What the references say has no error of counting."""
    blocks = one.density - other.density
    se = float(np.sqrt(len(blocks)) * np.std(blocks, ddof=1)) if len(blocks) > 1 else 0.0
    return Difference(one.total - other.total, se)


def explanation(table: Table, slots: Sequence[int]) -> Explanation:
    """The set of terms, scored."""
    columns = table.columns(slots)
    grams = unit_grams(table, columns)
    p = table.runs[0].base.shape[1]
    size = np.sqrt(np.maximum(np.einsum("uii->i", grams), 1e-300))
    size[: 1 + p] = 1.0
    scale = size[1 + p :]
    grams /= np.outer(size, size)
    density, reference = _predicted(table, grams)
    total = grams.sum(axis=0)
    beta = _solutions(total[None])[0][p:] / scale
    return Explanation(tuple(slots), density, reference, beta)


def _predicted(table: Table, grams: Floats) -> tuple[Floats, float]:
    units = table.units
    apart = np.array([key[0] == REFERENCE for key in units.key])
    by_block = np.zeros((units.blocks, *grams.shape[1:]))
    np.add.at(by_block, units.block, grams)
    count = units.blocks
    near = units.near.copy()
    # The only rows that tell of a common factor cannot predict themselves: references always take part.
    near[units.block[apart]] = 0.0
    near[:, units.block[apart]] = 0.0
    train = by_block.sum(axis=0) - np.tensordot(near, by_block, axes=1)
    weights = np.concatenate([np.ones((count, 1)), -_solutions(train)], axis=1)[units.block]
    squares = np.maximum(np.einsum("ui,uij,uj->u", weights, grams, weights), 0.0)
    tail = np.array([table.noise.tails[key] for key in units.key])
    each = log_density(squares, units.rows, tail)
    density = np.bincount(units.block[~apart], weights=each[~apart], minlength=count)
    kept = np.unique(units.block[~apart])
    return density[kept], float(np.sum(each[apart]))


def _solutions(grams: Floats) -> Floats:
    """Least-squares coefficients of Gram matrices (B, m, m), target first in rows and columns: (B, m - 1)."""
    A, b = grams[:, 1:, 1:].copy(), grams[:, 1:, :1]
    if A.shape[1] == 0:
        return np.zeros((len(A), 0))
    diagonal = np.einsum("bii->bi", A)
    # A column without data in the training part stays out of it: nothing is claimed there.
    diagonal += _RIDGE * np.maximum(diagonal.mean(axis=1, keepdims=True), 1e-12)
    return np.asarray(np.linalg.solve(A, b)[:, :, 0], dtype=np.float64)
