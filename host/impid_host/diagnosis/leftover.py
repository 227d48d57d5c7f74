"""What the chosen explanation leaves unnamed: structures, lines, walks, unsteady parts; and its adequacy."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impid_host.diagnosis.lines import spectral_lines
from impid_host.diagnosis.oddities import Oddity
from impid_host.diagnosis.result import Structure
from impid_host.diagnosis.shapes import structures
from impid_host.diagnosis.table import Table, residuals
from impid_host.diagnosis.unsteady import unsteady
from impid_host.diagnosis.wander import wandering
from impid_host.effects.structure import channel_name
from impid_host.effects.view import ANGLE, View


@dataclass(frozen=True, slots=True)
class Leftover:
    """Structures without a name, and how much each changes its channel, in squares of innovations."""

    structures: tuple[Structure, ...]
    squares: dict[str, float]


def left_over(table: Table, named: Sequence[int], unnamed: Sequence[int], views: Sequence[View]) -> Leftover:
    """Of the set of named and unnamed slots."""
    everything = [*named, *unnamed]
    found = structures(table, named, unnamed, views)
    found += spectral_lines(table, everything, table.noise.taps)
    found += wandering(table, everything, table.noise.taps)
    if not found:
        found = unsteady(table, everything, views)
    power = power_by_channel(table, everything)
    squares: dict[str, float] = {}
    for s in unnamed:
        for key, change in changes(table, everything, s).items():
            squares[key] = squares.get(key, 0.0) + change
    for row in found[len(unnamed) :]:
        squares[row.on] = squares.get(row.on, 0.0) + row.share * power.get(row.on, 0.0)
    return Leftover(tuple(found), squares)


def power_by_channel(table: Table, slots: Sequence[int]) -> dict[str, float]:
    """Squares of the innovations that the set leaves, by channel."""
    result: dict[str, float] = {}
    for run, r in zip(table.runs, residuals(table, table.columns(slots)), strict=True):
        if run.family in ("torque", "force", "specific_force"):
            name = channel_name(*run.key)
            result[name] = result.get(name, 0.0) + float(r @ r)
    return result


def changes(table: Table, slots: Sequence[int], s: int) -> dict[str, float]:
    """By how much a slot of the set lowers the squares of each channel, the others refitted without it."""
    rest = [other for other in slots if other != s]
    before, after = power_by_channel(table, rest), power_by_channel(table, slots)
    return {name: max(before[name] - after[name], 0.0) for name in after}


def believable(table: Table, named: Sequence[int], unnamed: Sequence[int], left: Leftover) -> list[int]:
    """The named slots beside which no structure of their own size stands in the channel in which they show.

    Where as much is left there as the name took away, the name is only what the structure resembles.
    """
    kept = []
    for s in named:
        own = changes(table, [*named, *unnamed], s)
        if not own or max(own.values()) == 0.0:
            kept.append(s)
            continue
        shown = max(own, key=lambda name: own[name])
        if own[shown] >= left.squares.get(shown, 0.0) or _in_angles(table, s):
            kept.append(s)
    return kept


def _in_angles(table: Table, s: int) -> bool:
    """Whether the slot shows in the angles' difference, of which no structure is sought."""
    columns = table.columns([s])
    return any(run.family == ANGLE and run.has(columns) for run in table.runs)


def odd_structures(oddities: Sequence[Oddity]) -> list[Structure]:
    """Rows that were left out before any model was asked, as entries of what is unexplained."""
    none = np.zeros((0, 2))
    return [
        Structure("one_trial", own.on, own.share, none, none, own.words) for own in oddities if own.share > 0
    ]
