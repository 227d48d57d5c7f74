"""Whether the data support an effect: test, size, cross-validation, bootstrap."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from impid_host.diagnosis.evidence import gain, projected, solve
from impid_host.diagnosis.table import Table, is_known, price
from impid_host.signals.arrays import Floats

BLOCK_S = 2.0
_P_VALUE = 1e-3  # after multiplication by the number of candidates tried
_ENERGY = 0.04  # least part of a row's noise variance that an effect must explain where it shows
_RELATIVE = 0.002  # of what the other effects explain
_PART = 0.3  # of its largest drop: a channel in which an effect shows
_FOLDS = 8
_STIFF = 0.01
_RESAMPLES = 80
_INCLUSION = 0.8


def supported(table: Table, active: Sequence[int], s: int) -> bool:
    """Prewhitened F-test, size of the effect, blockwise cross-validation and bootstrap inclusion."""
    if p_value(table, active, s) > _P_VALUE:
        return False
    shown = channels(table, active, s)
    if energy(shown) < _ENERGY or not is_large(shown):
        return False
    blocks = block_grams(table, [*active, s])
    return carries_over(blocks, table.slots[s].candidate.size) and inclusion(table, blocks, s) >= _INCLUSION


@dataclass(frozen=True, slots=True)
class Shown:
    """What a slot does in one channel: drop of its squares, what the others explain there, rows."""

    drop: float
    explained: float
    rows: int


def channels(table: Table, active: Sequence[int], s: int) -> list[Shown]:
    """Of the slot given `active`, in each channel."""
    columns = table.columns([*active, s])
    own = len(columns) - table.slots[s].candidate.size
    with_it, _ = solve(table.G, columns)
    without_it, _ = solve(table.G, columns[:own])
    squares: dict[tuple[str, int], Floats] = {}
    for run in table.runs:
        used = run.design[:, columns]
        r0 = run.target - used[:, :own] @ without_it
        r1 = run.target - used @ with_it
        entry = squares.setdefault(run.key, np.zeros(4))
        entry += np.array([run.target @ run.target, r0 @ r0, r1 @ r1, len(r0)])
    return [
        Shown(float(before - after), float(none - before), int(rows))
        for none, before, after, rows in squares.values()
    ]


def energy(shown: Sequence[Shown]) -> float:
    """Drop of the mean squared innovation in the channel where the slot explains most."""
    return max(one.drop / one.rows for one in shown)


def is_large(shown: Sequence[Shown]) -> bool:
    """More than what an imperfect shape of a much larger effect leaves behind, in a channel that matters."""
    most = max(one.drop for one in shown)
    return any(one.drop > _RELATIVE * one.explained for one in shown if one.drop > _PART * most)


def p_value(table: Table, active: Sequence[int], s: int) -> float:
    """F-test of the slot given `active`, times the number of slots tried."""
    slot = table.slots[s]
    P = projected(table.G, table.columns(active))
    drop = gain(P, table.G, slot.columns)
    size = slot.candidate.size + (len(slot.candidate.shapes) > 1)
    free = table.rows - len(table.columns(active)) - size
    F = (drop / size) / max((P[0, 0] - drop) / free, 1e-300)
    tried = sum(is_known(other) for other in table.slots)
    return float(min(1.0, stats.f.sf(F, size, free) * tried))


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
    # Where the training part leaves a column without data, nothing is claimed there.
    stiff = np.zeros(blocks.shape[1:])
    mean = float(np.mean(np.diag(blocks.sum(axis=0))[-size:]))
    stiff[-size:, -size:] = _STIFF * mean * np.eye(size)
    gains = []
    for fold in np.array_split(np.arange(count), _FOLDS):
        near = (np.arange(count) >= fold[0] - 1) & (np.arange(count) <= fold[-1] + 1)
        train = blocks[~near].sum(axis=0) + stiff
        full, part = _coefficients(train, 0), _coefficients(train, size)
        gains += [_squares(block, part) - _squares(block, full) for block in blocks[fold]]
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
