"""How much of a long study the choice looks at: its rows times its candidates must fit in memory.

Six minutes tell causes apart as well as an hour does. What is reported (values, intervals, held-out error)
is of all trials.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impid_host.effects.view import View

MOST_S = 400.0  # eight trials of 50 s
_LEAST_S = 15.0  # of a trial: of less, filters and noise models leave little


def sampled(parts: Sequence[View], most_s: float = MOST_S) -> tuple[View, ...]:
    """The views, of a long study with less marked as to be used.

    Of every trial the beginnings of its first two thirds and of its last, which is where held-out rows may
    begin; where that would be too little, of fewer trials, evenly spread over each load's.

    Args:
        most_s: seconds that are kept.
    """
    total = sum(float(np.sum(view.valid)) * view.dt for view in parts)
    if total <= most_s:
        return tuple(parts)
    few = _spread(parts, int(most_s / _LEAST_S))
    kept = [view for view, used in zip(parts, few, strict=True) if used]
    share = min(1.0, most_s / sum(float(np.sum(view.valid)) * view.dt for view in kept))
    return tuple(_beginning(view, share if used else 0.0) for view, used in zip(parts, few, strict=True))


def _spread(parts: Sequence[View], most: int) -> list[bool]:
    """Which trials, each load's first, then each load's last, and so on inwards."""
    groups: dict[str | None, list[int]] = {}
    for index, view in enumerate(parts):
        groups.setdefault(view.load, []).append(index)
    # A load's last trial may be the one that is set aside, so it comes second.
    orders = [own[:1] + own[:0:-1] for own in groups.values()]
    turns = [own[turn] for turn in range(max(map(len, orders))) for own in orders if turn < len(own)]
    # Free trials tell of the robot alone: two of them whatever the number of loads.
    free = groups.get(None, [])
    wanted = list(dict.fromkeys([*free[:1], *free[-1:], *turns]))[:most]
    return [index in wanted for index in range(len(parts))]


def _beginning(view: View, share: float) -> View:
    cut = 2 * view.t[-1] / 3
    kept = np.where(view.t < cut, view.t < share * cut, view.t < cut + share * (view.t[-1] - cut))
    return replace(view, valid=view.valid & kept & (share > 0))
