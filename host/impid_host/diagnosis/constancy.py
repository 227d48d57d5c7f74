"""One value everywhere: a cause has the same parameters in each trial and each channel in which it acts.

What merely resembles a cause is fitted best by other values here than there. So the coefficients of a name
are asked once more, in each channel of each trial by itself, beside all that the model holds: what that takes
away besides, over what the name takes away, is the share of it that is not constant (after Nyblom, Testing
for the constancy of parameters over time, J. American Statistical Association 84, 1989).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from impid_host.diagnosis.rows import REFERENCE
from impid_host.diagnosis.table import Table, beside, residuals, swept
from impid_host.signals.arrays import Floats

_CHANCE = 1e-4
_TOLD = 1e-3  # of a direction's largest information: less does not tell a value
_UNTOLD = 0.2  # of what a name takes: so much hidden, it may be another of its kin as well


@dataclass(frozen=True, slots=True)
class Constancy:
    """Shares of what a name takes away with the same values everywhere.

    Attributes:
        varies: what values of its own in each channel of each trial would take away besides, beyond chance.
        hidden: what they may take away by chance: of less the data say nothing.
    """

    varies: float
    hidden: float

    @property
    def trust(self) -> float:
        """How far the data show that it is constant, 0..1: not at all where a fifth of it could differ."""
        return max(0.0, 1.0 - self.hidden / _UNTOLD)


def constancies(table: Table, slots: Sequence[int], asked: Sequence[int]) -> dict[int, Constancy]:
    """Of some slots of a set."""
    left = residuals(table, table.columns(slots))
    return {s: _constancy(table, left, [o for o in slots if o != s], s) for s in asked}


def _constancy(table: Table, left: Sequence[Floats], others: Sequence[int], s: int) -> Constancy:
    columns, rest = table.columns([s]), table.columns(others)
    takes = max(swept(table, rest).drop(table.slots[s].columns), 1e-300)
    own = beside(table, columns, rest)
    besides, parameters = 0.0, 0
    for run, C, r in zip(table.runs, own, left, strict=True):
        if run.family == REFERENCE or not run.has(columns):
            continue
        more, free = _drop(C, r)
        besides, parameters = besides + more, parameters + free
    by_chance = 2.0 * float(special.gammaincinv(0.5 * parameters, 1.0 - _CHANCE)) if parameters else 0.0
    return Constancy(max(besides - by_chance, 0.0) / takes, by_chance / takes)


def _drop(C: Floats, r: Floats) -> tuple[float, int]:
    """Drop of the squares of r (N,) by the columns C (N, q), and how many of their directions tell."""
    values, vectors = np.linalg.eigh(C.T @ C)
    told = values > _TOLD * max(float(values[-1]), 1e-300)
    return float(np.sum((vectors[:, told].T @ (C.T @ r)) ** 2 / values[told])), int(told.sum())
