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
from scipy import sparse, special

from impid_host.diagnosis.noise import log_density
from impid_host.diagnosis.rows import REFERENCE, Index, Run
from impid_host.diagnosis.table import Table
from impid_host.signals.arrays import Floats

_RIDGE = 1e-9
_DRAWS = 4000
_KEPT_BYTES = 50_000_000  # of sums; beyond, they are formed anew


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
        self._base = _sums(table, _with_target, 1 + table.runs[0].base.shape[1], None)
        self._apart = np.array([key[0] == REFERENCE for key in table.units.key])
        self._tail = np.array([table.noise.tails[key] for key in table.units.key])
        near = table.units.near.copy()
        # The only rows that tell of a common factor cannot predict themselves: references always take part.
        near[table.units.block[self._apart]] = 0.0
        near[:, table.units.block[self._apart]] = 0.0
        self._near = sparse.csr_array(near)
        self._beside: dict[int, Floats] = {}
        self._between: dict[tuple[int, int], Floats] = {}

    def explanation(self, table: Table, slots: Sequence[int]) -> Explanation:
        """The set of terms, scored; the table may have grown by finer shapes."""
        grams = self._grams(table, slots)
        p = table.runs[0].base.shape[1]
        size = np.sqrt(np.maximum(np.einsum("bii->i", grams), 1e-300))
        size[: 1 + p] = 1.0
        grams /= np.outer(size, size)
        total = grams.sum(axis=0)
        train = (total.ravel() - self._near @ grams.reshape(len(grams), -1)).reshape(grams.shape)
        density, reference = self._predicted(table, slots, -_solutions(train) / size[1:])
        beta = _solutions(total[None])[0][p:] / size[1 + p :]
        return Explanation(tuple(slots), density, reference, beta)

    def _grams(self, table: Table, slots: Sequence[int]) -> Floats:
        """Gram matrices of [target | base | terms], one for each block of time, (B, m, m)."""
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
                self._beside[s] = _sums(table, _with_target, first, s)
            grams[:, :first, own] = self._beside[s]
            grams[:, own, :first] = np.swapaxes(self._beside[s], 1, 2)
            for j in range(k + 1):
                pair = (slots[j], s)
                if pair not in self._between:
                    columns = table.columns([slots[j]])
                    self._between[pair] = _sums(table, _of_terms(columns), len(columns), s)
                other = slice(places[j], places[j + 1])
                grams[:, other, own] = self._between[pair]
                grams[:, own, other] = np.swapaxes(self._between[pair], 1, 2)
        return grams

    def _predicted(self, table: Table, slots: Sequence[int], weights: Floats) -> tuple[Floats, float]:
        """Log density of each block, and of the references.

        Args:
            weights: of [base | terms] as found without the block, the other way round, (B, m - 1).
        """
        units, columns, apart = self._units, table.columns(slots), self._apart
        p = table.runs[0].base.shape[1]
        squares = np.zeros(len(units.rows))
        for run, (begins, places) in zip(table.runs, units.edges, strict=True):
            C = run.columns(columns) if run.has(columns) else None
            for place, begin, end in zip(places, begins, [*begins[1:], len(run.target)], strict=True):
                own = weights[units.block[place]]
                left = run.target[begin:end] + run.base[begin:end] @ own[:p]
                if C is not None:
                    left += C[begin:end] @ own[p:]
                squares[place] = left @ left
        each = log_density(squares, units.rows, self._tail)
        density = np.bincount(units.block[~apart], weights=each[~apart], minlength=units.blocks)
        return density[np.unique(units.block[~apart])], float(np.sum(each[apart]))


def _with_target(run: Run) -> Floats:
    return np.column_stack([run.target, run.base])


def _of_terms(columns: Index) -> Callable[[Run], Floats]:
    return lambda run: run.columns(columns)


def _sums(table: Table, left: Callable[[Run], Floats], width: int, slot: int | None) -> Floats:
    """Sums of products of some columns, `width` of them, with a slot's, by block of time, (B, width, q).

    Args:
        slot: None for the products with the columns themselves.
    """
    columns = table.columns([] if slot is None else [slot])
    units = table.units
    result = np.zeros((units.blocks, width, width if slot is None else len(columns)))
    for run, (begins, places) in zip(table.runs, units.edges, strict=True):
        if slot is not None and not run.has(columns):
            continue
        A = left(run)
        C = A if slot is None else run.columns(columns)
        # Fifty rows at a time: a product of two small matrices is faster than all products and their sums.
        for place, begin, end in zip(places, begins, [*begins[1:], len(C)], strict=True):
            result[units.block[place]] += A[begin:end].T @ C[begin:end]
    return result


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
