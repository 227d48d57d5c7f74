"""The rows that the choice works on, and what a candidate is worth on them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.diagnosis.evidence import gain, gram, projected, solve
from impid_host.diagnosis.result import UNATTRIBUTED
from impid_host.diagnosis.rows import Run, Slot, slots_of
from impid_host.effects.effect import Candidate
from impid_host.signals.arrays import Floats

_PARSIMONY = 0.005
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
    parameters = slot.candidate.size - slot.candidate.nuisance + (len(slot.candidate.shapes) > 1)
    known = 1.0 - _PARSIMONY * parameters if is_known(slot) else 1.0
    return known * drop - price(slot, rows)


def is_known(slot: Slot) -> bool:
    """A row of the catalogue, not a curve without a cause."""
    return slot.candidate.effect != UNATTRIBUTED


def score_of(table: Table, rest: Sequence[int], s: int) -> float:
    """Drop of the RSS less the price, the rest given."""
    P = projected(table.G, table.columns(rest))
    return worth(gain(P, table.G, table.slots[s].columns), table.slots[s], table.rows)


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
