"""The sealed part: it judges the whole, once, and nothing is cut from it."""

from collections.abc import Mapping

import numpy as np

from impid_host.diagnosis.case import Case
from impid_host.diagnosis.correct import corrected
from impid_host.diagnosis.events import Event, events
from impid_host.diagnosis.holdout import SEALED
from impid_host.diagnosis.noise import Taps, whitened
from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.rows import rows_of

_CHANCE = 1.05  # of the rms of a channel that an explanation does not touch, refitted beside it


def worse(last: Mapping[str, float], first: Mapping[str, float]) -> bool:
    """Whether all names predict the sealed part worse: in total, or in any channel by more than chance."""
    ratios = np.array([last[key] / max(before, 1e-300) for key, before in first.items() if key in last])
    return bool(len(ratios) and (np.mean(np.log(ratios)) > 0.0 or ratios.max() > _CHANCE))


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
