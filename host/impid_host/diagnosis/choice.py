"""The choice: which effects the whitened rows support, one after another, re-checked backwards."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from impid_host.diagnosis.evidence import gain, gram, projected, solve
from impid_host.diagnosis.result import UNATTRIBUTED
from impid_host.diagnosis.rows import Run, Slot, slots_of
from impid_host.effects.effect import Candidate
from impid_host.signals.arrays import Floats

BLOCK_S = 2.0
MAX_EFFECTS = 6
_P_VALUE = 1e-3  # after multiplication by the number of candidates tried
_ENERGY = 0.04  # least part of a row's noise variance that an effect must explain where it shows
_RELATIVE = 0.002  # of what the other effects explain
_PART = 0.3  # of its largest drop: a channel in which an effect shows
_PARSIMONY = 0.005
_FOLDS = 8
_STIFF = 0.01
_RESAMPLES = 80
_INCLUSION = 0.8
_SHORTLIST = 8
_FINER = 9


Maker = Callable[[Sequence[Slot]], list[Floats]]


@dataclass(frozen=True, slots=True)
class Table:
    """Whitened rows with the base model regressed out; columns are the slots' alone.

    Attributes:
        runs: of the fit part; G: their Gram matrix; rows: how many.
        slots: candidates at their shapes.
        make: columns of further slots on the same rows, alike whitened and freed of the base model.
    """

    runs: tuple[Run, ...]
    G: Floats
    rows: int
    slots: tuple[Slot, ...]
    make: Maker

    def columns(self, active: Sequence[int]) -> list[int]:
        """Columns of the slots in `active`, in their order."""
        return [k for s in active for k in range(self.slots[s].columns.start, self.slots[s].columns.stop)]

    def with_shapes(self, candidate: Candidate, shapes: Sequence[float]) -> "Table":
        """The table with the candidate's columns at further shapes behind the others."""
        width = self.runs[0].design.shape[1]
        fresh = slots_of([replace(candidate, shapes=tuple(shapes))], width)
        fresh = [replace(slot, candidate=candidate) for slot in fresh]
        columns = self.make(fresh)
        runs = [
            replace(run, design=np.hstack([run.design, new]))
            for run, new in zip(self.runs, columns, strict=True)
        ]
        old = np.concatenate([np.column_stack([run.target, run.design]) for run in self.runs])
        new = np.concatenate(columns)
        cross = old.T @ new
        G = np.block([[self.G, cross], [cross.T, new.T @ new]])
        return replace(self, runs=tuple(runs), G=G, slots=(*self.slots, *fresh))


def table_of(runs: Sequence[Run], slots: Sequence[Slot], make: Maker) -> Table:
    """From runs whose base columns are gone; slots count from column 0."""
    fit = tuple(run for run in runs if run.part == "fit")
    total = gram(fit)
    return Table(fit, total.G, total.rows, tuple(slots), make)


def price(slot: Slot, rows: int) -> float:
    """Schwarz's price of a candidate's parameters, the non-linear one among them."""
    return float(np.log(rows)) * (slot.candidate.size + (len(slot.candidate.shapes) > 1))


def worth(drop: float, slot: Slot, rows: int) -> float:
    """Score of a drop of the RSS: less the price, and less a part of the drop for each parameter.

    Of an effect a hundred times the noise, what the model's own small errors leave is significant too; a
    parameter more is believed if it explains half a percent more.
    """
    parameters = slot.candidate.size + (len(slot.candidate.shapes) > 1)
    known = 1.0 - _PARSIMONY * parameters if is_known(slot) else 1.0
    return known * drop - price(slot, rows)


def is_known(slot: Slot) -> bool:
    """A row of the catalogue, not a curve without a cause."""
    return slot.candidate.effect != UNATTRIBUTED


def ranking(table: Table, active: Sequence[int], *, known: bool = True) -> list[tuple[float, int]]:
    """(score, slot) of every slot that may be added to `active`, best first; score: drop of RSS less price.

    Args:
        known: rows of the catalogue; otherwise the curves without a cause.
    """
    P = projected(table.G, table.columns(active))
    taken = {(table.slots[s].candidate.effect, table.slots[s].candidate.where) for s in active}
    scored = []
    for index, slot in enumerate(table.slots):
        if is_known(slot) != known or (slot.candidate.effect, slot.candidate.where) in taken:
            continue
        scored.append((worth(gain(P, table.G, slot.columns), slot, table.rows), index))
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


def possible(table: Table, active: Sequence[int], curves: Sequence[int]) -> list[int]:
    """The effects of `active` whose parameters are physically possible when all are fitted together."""
    beta, _ = solve(table.G, table.columns([*active, *curves]))
    kept, first = [], 0
    for s in active:
        slot = table.slots[s]
        if slot.candidate.gate(beta[first : first + slot.candidate.size], slot.shape):
            kept.append(s)
        first += slot.candidate.size
    return kept


def choose(table: Table, given: Sequence[int] = ()) -> tuple[Table, list[int]]:
    """Slots of the effects that the data support, in the order in which they were found.

    Args:
        given: slots that are in the model whatever happens.

    Returns:
        the table with the refined shapes, and the slots in it, without those given.
    """
    given = list(given)
    active: list[int] = []
    tried: set[tuple[int, ...]] = set()
    while len(active) < MAX_EFFECTS:
        table, found = best(table, [*given, *active])
        if found is None or not supported(table, [*given, *active], found):
            table, found = companion(table, given, active)
        if found is None:
            break
        active = [*active, found]
        for _ in range(2):
            table, active = refined(table, given, active)
            active = pruned(table, given, swapped(table, given, active))
        if tuple(sorted(active)) in tried:
            break
        tried.add(tuple(sorted(active)))
    return table, active


def companion(table: Table, given: Sequence[int], active: Sequence[int]) -> tuple[Table, int | None]:
    """Plain dry friction beside a Stribeck friction whose speed has grown to stand for both.

    Each alone explains nearly all of the two, so that neither looks worth adding before the speed is fitted
    anew.
    """
    places = {s: table.slots[s].candidate.where for s in active if _is(table, s, "friction.stribeck")}
    for s, where in places.items():
        own = [
            k
            for k, slot in enumerate(table.slots)
            if _is(table, k, "friction.coulomb") and slot.candidate.where == where
        ]
        if not own or own[0] in active:
            continue
        rest = [*given, *(other for other in active if other != s)]
        finer, better = refined_one(table, [*rest, own[0]], s)
        if supported(finer, [*rest, better], own[0]) and admissible(finer, [*active, own[0]]):
            return finer, own[0]
    return table, None


def _is(table: Table, s: int, effect: str) -> bool:
    return table.slots[s].candidate.effect == effect


def best(table: Table, active: Sequence[int]) -> tuple[Table, int | None]:
    """The admissible slot of highest score; close contenders are compared at their best shapes."""
    contenders = _contenders(table, active)
    if not contenders:
        return table, None
    top = contenders[0][0]
    for score, s in contenders[:4]:
        if len(table.slots[s].candidate.shapes) > 1 and score > 0.6 * top:
            table, _ = refined_one(table, active, s)
    contenders = _contenders(table, active)
    return table, contenders[0][1] if contenders else None


def _contenders(table: Table, active: Sequence[int]) -> list[tuple[float, int]]:
    """The best slot of each candidate, best first."""
    seen: set[tuple[str, tuple[str, ...], str]] = set()
    result: list[tuple[float, int]] = []
    for score, s in ranking(table, active):
        candidate = table.slots[s].candidate
        key = (candidate.effect, candidate.where, candidate.variant)
        if score <= 0 or len(result) >= _SHORTLIST:
            break
        if key not in seen and admissible(table, [*active, s]):
            seen.add(key)
            result.append((score, s))
    return result


def refined(table: Table, given: Sequence[int], active: list[int]) -> tuple[Table, list[int]]:
    """Every non-linear parameter in `active` improved, one after another."""
    for place, s in enumerate(active):
        if len(table.slots[s].candidate.shapes) > 1:
            rest = [*given, *(other for other in active if other != s)]
            table, better = refined_one(table, rest, s)
            active = [*active[:place], better, *active[place + 1 :]]
    return table, active


def refined_one(table: Table, rest: Sequence[int], s: int) -> tuple[Table, int]:
    """Two rounds of finer shapes around the slot's own, the rest of the model given (variable projection)."""
    candidate = table.slots[s].candidate
    P = projected(table.G, table.columns(rest))
    own = [k for k, slot in enumerate(table.slots) if slot.candidate is candidate]
    s = max(own, key=lambda k: gain(P, table.G, table.slots[k].columns))
    for _ in range(2):
        own = [k for k, slot in enumerate(table.slots) if slot.candidate is candidate]
        shapes = np.unique([table.slots[k].shape for k in own])
        here = int(np.searchsorted(shapes, table.slots[s].shape))
        left, right = shapes[max(here - 1, 0)], shapes[min(here + 1, len(shapes) - 1)]
        if right - left < 1e-4 * abs(shapes[here]):
            break
        fresh = np.linspace(left, right, _FINER)[1:-1]
        table = table.with_shapes(candidate, [float(v) for v in fresh if abs(v - shapes[here]) > 1e-12])
        P = projected(table.G, table.columns(rest))
        own = [k for k, slot in enumerate(table.slots) if slot.candidate is candidate]
        s = max(own, key=lambda k: gain(P, table.G, table.slots[k].columns))
    return table, s


def pruned(table: Table, given: Sequence[int], active: list[int]) -> list[int]:
    """Without the effects that the others explain away."""
    for s in list(active):
        rest = [other for other in active if other != s]
        if rest and not supported(table, [*given, *rest], s):
            active = rest
    return active


def swapped(table: Table, given: Sequence[int], active: list[int]) -> list[int]:
    """Each effect replaced by a better one, given the others, while that helps."""
    for _ in range(2):
        for place, s in enumerate(active):
            rest = [*given, *(other for other in active if other != s)]
            own = score_of(table, rest, s)
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


def score_of(table: Table, rest: Sequence[int], s: int) -> float:
    """Drop of the RSS less the price, the rest given."""
    P = projected(table.G, table.columns(rest))
    return worth(gain(P, table.G, table.slots[s].columns), table.slots[s], table.rows)


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
