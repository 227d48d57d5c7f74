"""The choice: which effects the whitened rows support, one after another, re-checked backwards."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from impid_host.diagnosis.evidence import gain, gram, projected, solve
from impid_host.diagnosis.rows import Run, Slot
from impid_host.signals.arrays import Floats

BLOCK_S = 2.0
MAX_EFFECTS = 6
_P_VALUE = 1e-3  # after multiplication by the number of candidates tried
_ENERGY = 0.04  # least part of a row's noise variance that an effect must explain where it shows
_FOLDS = 8
_RESAMPLES = 80
_INCLUSION = 0.8
_SHORTLIST = 14


@dataclass(frozen=True, slots=True)
class Table:
    """Whitened rows with the base model regressed out; columns are the slots' alone.

    Attributes:
        runs: of the fit part; G: their Gram matrix; rows: how many.
        slots: candidates at their shapes.
    """

    runs: tuple[Run, ...]
    G: Floats
    rows: int
    slots: tuple[Slot, ...]

    def columns(self, active: Sequence[int]) -> list[int]:
        """Columns of the slots in `active`, in their order."""
        return [k for s in active for k in range(self.slots[s].columns.start, self.slots[s].columns.stop)]


def table_of(runs: Sequence[Run], slots: Sequence[Slot]) -> Table:
    """From runs whose base columns are gone; slots count from column 0."""
    fit = tuple(run for run in runs if run.part == "fit")
    total = gram(fit)
    return Table(fit, total.G, total.rows, tuple(slots))


def price(slot: Slot, rows: int) -> float:
    """Schwarz's price of a candidate's parameters, the non-linear one among them."""
    return float(np.log(rows)) * (slot.candidate.size + (len(slot.candidate.shapes) > 1))


def ranking(table: Table, active: Sequence[int]) -> list[tuple[float, int]]:
    """(score, slot) of every slot that may be added to `active`, best first; score: drop of RSS less price."""
    P = projected(table.G, table.columns(active))
    taken = {(table.slots[s].candidate.effect, table.slots[s].candidate.where) for s in active}
    scored = []
    for index, slot in enumerate(table.slots):
        if (slot.candidate.effect, slot.candidate.where) in taken:
            continue
        scored.append((gain(P, table.G, slot.columns) - price(slot, table.rows), index))
    return sorted(scored, reverse=True)


def admissible(table: Table, active: Sequence[int]) -> bool:
    """Whether every effect of `active` has physically possible parameters when all are fitted together."""
    beta, _ = solve(table.G, table.columns(active))
    first = 0
    for s in active:
        slot = table.slots[s]
        if not slot.candidate.gate(beta[first : first + slot.candidate.size], slot.shape):
            return False
        first += slot.candidate.size
    return True


def choose(table: Table) -> list[int]:
    """Slots of the effects that the data support, in the order in which they were found."""
    active: list[int] = []
    refused: set[tuple[int, ...]] = set()
    while len(active) < MAX_EFFECTS:
        found = next(
            (
                s
                for score, s in ranking(table, active)[:40]
                if score > 0 and (*active, s) not in refused and admissible(table, [*active, s])
            ),
            None,
        )
        if found is None or not supported(table, active, found):
            break
        refused.add((*active, found))
        active = swapped(table, pruned(table, [*active, found]))
    return active


def pruned(table: Table, active: list[int]) -> list[int]:
    """Without the effects that the others explain away."""
    for s in list(active):
        rest = [other for other in active if other != s]
        if rest and not supported(table, rest, s):
            active = rest
    return active


def swapped(table: Table, active: list[int]) -> list[int]:
    """Each effect replaced by a better one, given the others, while that helps."""
    for _ in range(2):
        for place, s in enumerate(active):
            rest = [other for other in active if other != s]
            own = _score(table, rest, s)
            better = next(
                (
                    other
                    for score, other in ranking(table, rest)[:10]
                    if score > own + 2.0 and admissible(table, [*rest, other])
                ),
                None,
            )
            if better is not None:
                active = [*active[:place], better, *active[place + 1 :]]
    return active


def _score(table: Table, rest: Sequence[int], s: int) -> float:
    P = projected(table.G, table.columns(rest))
    return gain(P, table.G, table.slots[s].columns) - price(table.slots[s], table.rows)


def supported(table: Table, active: Sequence[int], s: int) -> bool:
    """Prewhitened F-test, size of the effect, blockwise cross-validation and bootstrap inclusion."""
    if p_value(table, active, s) > _P_VALUE or energy(table, active, s) < _ENERGY:
        return False
    blocks = block_grams(table, [*active, s])
    return carries_over(blocks, table.slots[s].candidate.size) and inclusion(table, blocks, s) >= _INCLUSION


def p_value(table: Table, active: Sequence[int], s: int) -> float:
    """F-test of the slot given `active`, times the number of slots tried."""
    slot = table.slots[s]
    P = projected(table.G, table.columns(active))
    drop = gain(P, table.G, slot.columns)
    size = slot.candidate.size + (len(slot.candidate.shapes) > 1)
    free = table.rows - len(table.columns(active)) - size
    F = (drop / size) / max((P[0, 0] - drop) / free, 1e-300)
    return float(min(1.0, stats.f.sf(F, size, free) * len(table.slots)))


def energy(table: Table, active: Sequence[int], s: int) -> float:
    """Drop of the mean squared innovation in the channel where the slot explains most."""
    columns = np.array(table.columns([*active, s]))
    own = len(columns) - table.slots[s].candidate.size
    with_it, _ = solve(table.G, columns)
    without_it, _ = solve(table.G, columns[:own])
    before: dict[tuple[str, int], list[float]] = {}
    for run in table.runs:
        r0 = run.target - run.design[:, columns[:own]] @ without_it
        r1 = run.target - run.design[:, columns] @ with_it
        entry = before.setdefault(run.key, [0.0, 0.0])
        entry[0] += float(r0 @ r0 - r1 @ r1)
        entry[1] += len(r0)
    return max(drop / rows for drop, rows in before.values())


def block_grams(table: Table, active: Sequence[int]) -> Floats:
    """Gram matrices of [target | columns of `active`], one for each trial and BLOCK_S: (b, 1 + k, 1 + k)."""
    columns = table.columns(active)
    blocks: dict[tuple[str, int], Floats] = {}
    for run in table.runs:
        Z = np.column_stack([run.target, run.design[:, columns]])
        number = ((run.begin_s + run.step_s * np.arange(len(Z))) // BLOCK_S).astype(int)
        for block in np.unique(number):
            part = Z[number == block]
            key = (run.trial, int(block))
            blocks[key] = blocks.get(key, 0.0) + part.T @ part
    return np.array([blocks[key] for key in sorted(blocks)])


def carries_over(blocks: Floats, size: int) -> bool:
    """Cross-validation over contiguous folds with a block's gap: a gain of more than two standard errors."""
    count = len(blocks)
    if count < 2 * _FOLDS:
        return True
    gains = []
    for fold in np.array_split(np.arange(count), _FOLDS):
        near = (np.arange(count) >= fold[0] - 1) & (np.arange(count) <= fold[-1] + 1)
        train = blocks[~near].sum(axis=0)
        full, part = _coefficients(train, 0), _coefficients(train, size)
        for block in blocks[fold]:
            gains.append(_squares(block, part) - _squares(block, full))
    return bool(np.mean(gains) > 2 * np.std(gains) / np.sqrt(len(gains)))


def inclusion(table: Table, blocks: Floats, s: int) -> float:
    """Share of block bootstrap samples in which the last slot of `blocks` is still worth its price."""
    generator = np.random.default_rng(0)
    size = table.slots[s].candidate.size
    hits = 0
    for _ in range(_RESAMPLES):
        total = blocks[generator.integers(0, len(blocks), len(blocks))].sum(axis=0)
        drop = _squares(total, _coefficients(total, size)) - _squares(total, _coefficients(total, 0))
        hits += drop > price(table.slots[s], table.rows)
    return hits / _RESAMPLES


def _coefficients(G: Floats, dropped: int) -> Floats:
    """Coefficients on all columns but the last `dropped`, padded with zeros."""
    width = len(G) - 1
    beta = np.zeros(width)
    beta[: width - dropped] = solve(G, range(width - dropped))[0]
    return beta


def _squares(G: Floats, beta: Floats) -> float:
    weights = np.concatenate([[1.0], -beta])
    return float(weights @ G @ weights)
