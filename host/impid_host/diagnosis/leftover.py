"""What the chosen explanation leaves unnamed: structures, lines, walks, unsteady parts."""

from collections.abc import Sequence

import numpy as np

from impid_host.diagnosis.adequacy import REPORTED
from impid_host.diagnosis.lines import spectral_lines
from impid_host.diagnosis.oddities import Oddity
from impid_host.diagnosis.result import Structure
from impid_host.diagnosis.shapes import structures
from impid_host.diagnosis.table import Table, residuals
from impid_host.diagnosis.unsteady import unsteady
from impid_host.diagnosis.wander import wandering
from impid_host.effects.unnamed import channel_name
from impid_host.effects.view import View


def left_over(
    table: Table, named: Sequence[int], unnamed: Sequence[int], views: Sequence[View]
) -> tuple[Structure, ...]:
    """Structures without a name, of the set of named and unnamed slots."""
    everything = [*named, *unnamed]
    found = structures(table, named, unnamed, views)
    found += spectral_lines(table, everything, table.noise.taps)
    found += wandering(table, everything, table.noise.taps)
    if not found:
        found = unsteady(table, everything, views)
    return tuple(found)


def power_by_channel(table: Table, slots: Sequence[int]) -> dict[str, float]:
    """Squares of the innovations that the set leaves, by channel."""
    result: dict[str, float] = {}
    for run, r in zip(table.runs, residuals(table, table.columns(slots)), strict=True):
        if run.family in REPORTED:
            name = channel_name(*run.key)
            result[name] = result.get(name, 0.0) + float(r @ r)
    return result


def changes(table: Table, slots: Sequence[int], s: int) -> dict[str, float]:
    """By how much a slot of the set lowers the squares of each channel, the others refitted without it."""
    return _without_and_less(table, slots, s)[1]


def _without_and_less(
    table: Table, slots: Sequence[int], s: int
) -> tuple[dict[str, float], dict[str, float]]:
    """Squares that the others leave in each channel, and by how much the slot lowers them."""
    before = power_by_channel(table, [other for other in slots if other != s])
    after = power_by_channel(table, slots)
    return before, {name: max(before[name] - after[name], 0.0) for name in after}


def resemblance(table: Table, named: Sequence[int], s: int, *, constant: bool = True) -> Structure:
    """A name that is no cause, as an entry of what is unexplained.

    Args:
        constant: whether it is the same in all trials and channels.
    """
    before, less = _without_and_less(table, named, s)
    on = max(less, key=lambda name: less[name])
    none = np.zeros((0, 2))
    but = (
        "no more than it resembles other things"
        if constant
        else "of another size in other trials or channels"
    )
    words = f"{on} resembles {table.term(s).label}, but {but}"
    return Structure("time", on, less[on] / max(before[on], 1e-300), none, none, words)


def odd_structures(oddities: Sequence[Oddity]) -> list[Structure]:
    """Rows that were left out before any model was asked, as entries of what is unexplained."""
    none = np.zeros((0, 2))
    return [
        Structure("one_trial", own.on, own.share, none, none, own.words) for own in oddities if own.share > 0
    ]
