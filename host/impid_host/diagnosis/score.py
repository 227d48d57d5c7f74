"""How well an explanation (a set of terms) predicts blocks that took no part in fitting it.

For each block of two seconds the base model and the terms are fitted to all rows but that block and its
neighbours, and the block's log predictive density is taken, all channels together. Two explanations are
compared by the sum of the differences over the blocks and its standard error (Vehtari, Gelman and Gabry,
Statistics and Computing 27, 2017).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import special

from impid_host.diagnosis.noise import log_density
from impid_host.diagnosis.rows import REFERENCE, Run
from impid_host.diagnosis.table import Table
from impid_host.signals.arrays import Floats

_RIDGE = 1e-9
_DRAWS = 4000
_KEPT_BYTES = 100_000_000  # of sums; beyond, they are formed anew


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
    """By how much one explanation predicts better than another, nats, and its standard error.

    Attributes:
        blocks: of each block of time, (B,).
    """

    gain: float
    se: float
    blocks: Floats

    def surely(self, sigmas: float) -> bool:
        """Whether it is above zero by more than chance, as surely as so many standard errors of a Gaussian.

        By the Bayesian bootstrap (Rubin, Annals of Statistics 9, 1981): where a few blocks tell most and none
        tells otherwise, the standard error is large and there is no doubt.
        """
        fixed = self.gain - float(self.blocks.sum())
        totals = shares(len(self.blocks)) @ self.blocks + fixed
        return bool(np.quantile(totals, special.ndtr(-sigmas)) > 0.0)


@cache
def shares(blocks: int) -> Floats:
    """Weights of the blocks in each draw of the Bayesian bootstrap, (draws, B), each row summing to B."""
    result: Floats = np.random.default_rng(0).dirichlet(np.ones(blocks), _DRAWS) * blocks
    return result


def difference(one: Explanation, other: Explanation) -> Difference:
    """Positive where `one` predicts better. What the references say has no error of counting."""
    blocks = one.density - other.density
    se = float(np.sqrt(len(blocks)) * np.std(blocks, ddof=1)) if len(blocks) > 1 else 0.0
    return Difference(one.total - other.total, se, blocks)


class Scorer:
    """Scores sets of terms on one table's rows; the sums of a term are kept for the next set with it."""

    def __init__(self, table: Table) -> None:
        self._units = table.units
        self._base = _base_grams(table)
        self._apart = np.array([key[0] == REFERENCE for key in table.units.key])
        self._tail = np.array([table.noise.tails[key] for key in table.units.key])
        near = table.units.near.copy()
        # The only rows that tell of a common factor cannot predict themselves: references always take part.
        near[table.units.block[self._apart]] = 0.0
        near[:, table.units.block[self._apart]] = 0.0
        self._near = near
        self._beside: dict[int, Floats] = {}
        self._between: dict[tuple[int, int], Floats] = {}

    def explanation(self, table: Table, slots: Sequence[int]) -> Explanation:
        """The set of terms, scored; the table may have grown by finer shapes."""
        grams = self._grams(table, slots)
        p = table.runs[0].base.shape[1]
        size = np.sqrt(np.maximum(np.einsum("uii->i", grams), 1e-300))
        size[: 1 + p] = 1.0
        scale = size[1 + p :]
        grams /= np.outer(size, size)
        density, reference = self._predicted(grams)
        beta = _solutions(grams.sum(axis=0)[None])[0][p:] / scale
        return Explanation(tuple(slots), density, reference, beta)

    def _grams(self, table: Table, slots: Sequence[int]) -> Floats:
        """Gram matrices of [target | base | terms], one for each unit, (U, m, m)."""
        kept = [*self._beside.values(), *self._between.values()]
        if sum(own.nbytes for own in kept) > _KEPT_BYTES:
            self._beside.clear()
            self._between.clear()
        first = self._base.shape[1]
        sizes = [table.term(s).size for s in slots]
        places = first + np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        grams = np.zeros((len(self._base), places[-1], places[-1]))
        grams[:, :first, :first] = self._base
        for k, s in enumerate(slots):
            own = slice(places[k], places[k + 1])
            if s not in self._beside:
                self._beside[s] = _sums(table, lambda run: np.column_stack([run.target, run.base]), s)
            grams[:, :first, own] = self._beside[s]
            grams[:, own, :first] = np.swapaxes(self._beside[s], 1, 2)
            for j in range(k + 1):
                pair = (slots[j], s)
                if pair not in self._between:
                    columns = table.columns([slots[j]])
                    self._between[pair] = _sums(table, lambda run, c=columns: run.columns(c), s)  # type: ignore[misc]
                other = slice(places[j], places[j + 1])
                grams[:, other, own] = self._between[pair]
                grams[:, own, other] = np.swapaxes(self._between[pair], 1, 2)
        return grams

    def _predicted(self, grams: Floats) -> tuple[Floats, float]:
        units = self._units
        by_block = np.add.reduceat(grams[units.order], units.starts, axis=0)
        count, m = len(by_block), grams.shape[1]
        left_out = (self._near @ by_block.reshape(count, -1)).reshape(count, m, m)
        train = by_block.sum(axis=0) - left_out
        weights = np.concatenate([np.ones((count, 1)), -_solutions(train)], axis=1)[units.block]
        moved = np.matmul(grams, weights[:, :, None])[:, :, 0]
        squares = np.maximum(np.sum(weights * moved, axis=1), 0.0)
        each = log_density(squares, units.rows, self._tail)
        apart = self._apart
        density = np.bincount(units.block[~apart], weights=each[~apart], minlength=count)
        return density[np.unique(units.block[~apart])], float(np.sum(each[apart]))


def _base_grams(table: Table) -> Floats:
    """Of [target | base], one for each unit."""
    m = 1 + table.runs[0].base.shape[1]
    result = np.zeros((len(table.units.rows), m, m))
    for run, (begins, places) in zip(table.runs, table.units.edges, strict=True):
        Z = np.column_stack([run.target, run.base])
        for place, part in zip(places, np.split(Z, begins[1:]), strict=True):
            result[place] = part.T @ part
    return result


def _sums(table: Table, left: Callable[[Run], Floats], slot: int) -> Floats:
    """Sums of products of some columns with a slot's, by unit, (U, l, q)."""
    columns = table.columns([slot])
    parts: list[Floats] = []
    for run, (begins, _) in zip(table.runs, table.units.edges, strict=True):
        A = left(run)
        if not np.isin(columns, run.used, assume_unique=True).any():
            parts.append(np.zeros((len(begins), A.shape[1], len(columns))))
            continue
        products = A[:, :, None] * run.columns(columns)[:, None, :]
        parts.append(np.add.reduceat(products, begins, axis=0))
    return np.concatenate(parts)


def _solutions(grams: Floats) -> Floats:
    """Coefficients by each Gram matrix (B, m, m), first row and column the target's, (B, m - 1)."""
    A, b = grams[:, 1:, 1:].copy(), grams[:, 1:, :1]
    if A.shape[1] == 0:
        return np.zeros((len(A), 0))
    diagonal = np.einsum("bii->bi", A)
    # A column without data in the training part stays out of it: nothing is claimed there.
    small = _RIDGE * np.maximum(diagonal.mean(axis=1), 1e-12)
    A = A + small[:, None, None] * np.eye(A.shape[1])
    result: Floats = np.linalg.solve(A, b)[:, :, 0]
    return result
