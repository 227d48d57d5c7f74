"""The sealed part: it judges the whole, once, and nothing is cut from it."""

from collections.abc import Mapping, Sequence

import numpy as np

from impid_host.diagnosis.case import Case
from impid_host.diagnosis.correct import corrected
from impid_host.diagnosis.events import Event, events
from impid_host.diagnosis.holdout import SEALED
from impid_host.diagnosis.noise import Taps, whitened
from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.result import Chosen
from impid_host.diagnosis.rows import rows_of

_TOTAL = 1.01  # of the geometric mean over the channels
_CHANCE = 1.05  # of the rms of a channel that an explanation does not touch, refitted beside it


def worse(last: Mapping[str, float], first: Mapping[str, float], stretch: float = 1.0) -> bool:
    """Whether the model with all names predicts the sealed part worse: in total, or one channel by more
    than chance.

    Args:
        stretch: by which taking the effects out scales what was measured, noise and all.
    """
    ratios = np.array([last[key] / max(before, 1e-300) for key, before in first.items() if key in last])
    limit = _CHANCE * max(stretch, 1.0)
    return bool(len(ratios) and (np.mean(np.log(ratios)) > np.log(_TOTAL) or ratios.max() > limit))


def stretch_of(chosen: Sequence[Chosen]) -> float:
    """The largest factor by which taking the effects out scales a measured channel."""
    factors = [
        abs(factor)
        for part in chosen
        if part.term.stretch is not None
        for factor in part.term.stretch(part.beta).values()
    ]
    return max(factors, default=1.0)


def events_in_sealed(case: Case, fit: Refit, taps: Taps) -> list[Event]:
    """Stretches of the sealed part that the model leaves standing out: said beside the number."""
    runs = whitened(
        [
            run
            for view in fit.views
            for run in rows_of(corrected(view, fit.chosen), case.base, [], case.holdout, (SEALED,))
        ],
        taps,
    )
    return events(runs, [run.target - run.base @ fit.base for run in runs], case.views)
