"""What is set aside before anything is looked at: whole trials where there are enough, else last thirds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impid_host.effects.view import View
from impid_host.signals.arrays import Mask
from impid_host.signals.chain import DEFAULT, erode

FIT, SEALED = "fit", "validation"
GAP_S = 0.3  # a gap is bridged by a line, so the filters have less to forget there than at an end
_ENOUGH = 3  # trials of one kind and load, before one of them can be spared
THIRD, FIFTH = 1 / 3, 1 / 5
_PAUSE_S = 1.0  # noise and muscles remember too, where a record is long enough to wait for them


@dataclass(frozen=True, slots=True)
class Holdout:
    """Names of trials used for fitting and for validation; a name in both is split in time.

    Attributes:
        last: how much of a trial that is split is sealed, at its end.
        left_out: trial, beginning and end, s, of what the fit part does without. The sealed part keeps all.
    """

    fit: tuple[str, ...]
    validation: tuple[str, ...]
    left_out: tuple[tuple[str, float, float], ...] = ()
    last: float = THIRD

    def mask(self, view: View, part: str) -> Mask:
        """Instants of the `fit` or the `validation` part, (N,)."""
        inside = view.valid & (view.name in (self.fit if part == FIT else self.validation))
        if view.name in self.fit and view.name in self.validation:
            cut = (1 - self.last) * view.t[-1]
            pause_s = DEFAULT.with_cutoff(view.report_hz).edge_s  # what the filter remembers
            if self.last == THIRD:
                pause_s = max(pause_s, _PAUSE_S)
            inside = inside & (view.t < cut - pause_s if part == FIT else view.t >= cut)
        for trial, begin_s, end_s in self.left_out if part == FIT else ():
            if trial == view.name:
                inside = inside & ~((view.t > begin_s) & (view.t < end_s))
        return np.asarray(inside)


def settled(mask: Mask, rate_hz: float, ends_s: float) -> Mask:
    """Without `ends_s` at both ends of what is kept, and without a shorter margin beside gaps inside."""
    kept = np.flatnonzero(mask)
    if len(kept) == 0:
        return mask
    inner = erode(mask, int(min(ends_s, GAP_S) * rate_hz))
    reach = int(ends_s * rate_hz)
    inner[: kept[0] + reach] = False
    inner[max(kept[-1] + 1 - reach, 0) :] = False
    return inner


def hold_out(parts: Sequence[View]) -> Holdout:
    """Of three or more trials of one load (or free) the last; of fewer, the last third of each."""
    groups: dict[str | None, list[str]] = {}
    for view in parts:
        groups.setdefault(view.load, []).append(view.name)
    fit: list[str] = []
    validation: list[str] = []
    for names in groups.values():
        if len(names) >= _ENOUGH:
            fit += names[:-1]
            validation += names[-1:]
        else:
            fit += names
            validation += names
    return Holdout(tuple(sorted(fit)), tuple(sorted(validation)))
