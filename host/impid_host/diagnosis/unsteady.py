"""A residual much larger in one trial, or in one half of it, than in the rest: a drift, a trial gone wrong.

A noise model common to all trials takes such a part for noise; nothing then stands out in any test that
believes it. So the innovations of each half of each trial are compared with those of all the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage, stats

from impid_host.diagnosis.result import Structure
from impid_host.diagnosis.rows import Run
from impid_host.diagnosis.table import Table, residuals
from impid_host.effects.unnamed import channel_name
from impid_host.effects.view import TORQUE, View
from impid_host.signals.arrays import Floats

_RATIO = 4.0  # of a part's mean squared innovation to the usual, beyond what speed may do to noise
_P_VALUE = 1e-6
_LEAST_ROWS = 25
_SMOOTH_S = 0.5


@dataclass(frozen=True, slots=True)
class _Part:
    """Half of a trial's rows in one channel: mean squared innovation, rows, course of the residual (N, 2)."""

    trial: str
    level: float
    rows: int
    course: Floats


def unsteady(table: Table, slots: Sequence[int], views: Sequence[View]) -> list[Structure]:
    """One entry for each torque channel in which parts of trials stand out.

    Args:
        views: of the trials; noise may grow with the square of the speed.
    """
    speed = {
        (view.name, joint): v for view in views for joint, v in enumerate(np.mean(view.omega**2, axis=0))
    }
    left = list(zip(table.runs, residuals(table, table.columns(slots)), strict=True))
    result = []
    for key in sorted({run.key for run in table.runs if run.family == TORQUE}):
        parts = [part for run, r in left if run.key == key for part in _halves(run, r)]
        if len(parts) < 4:
            continue
        usual = float(np.median([part.level for part in parts]))
        typical = float(np.median([speed[part.trial, key[1]] for part in parts]))
        rows = sum(part.rows for part in parts)
        odd = [
            part
            for part in parts
            if part.level > _RATIO * usual * max(1.0, speed[part.trial, key[1]] / max(typical, 1e-300))
            and stats.f.sf(part.level / usual, part.rows / 2, rows / 2) * len(parts) < _P_VALUE
        ]
        if odd:
            result.append(_structure(channel_name(*key), odd, parts, usual))
    return result


def _halves(run: Run, left: Floats) -> list[_Part]:
    result = []
    for rows in np.array_split(np.arange(len(left)), 2):
        if len(rows) >= _LEAST_ROWS:
            smooth = ndimage.gaussian_filter1d(left[rows], _SMOOTH_S / run.step_s)
            course = np.stack([run.times[rows], smooth], axis=1)
            result.append(_Part(run.trial, float(np.mean(left[rows] ** 2)), len(rows), course))
    return result


def _structure(on: str, odd: Sequence[_Part], parts: Sequence[_Part], usual: float) -> Structure:
    """Whole trials, or a change within trials; with the course of the trial that stands out most."""
    worst = max(odd, key=lambda part: part.level)
    trials = sorted({part.trial for part in odd})
    whole = all(part in odd for part in parts if part.trial in trials)
    course = np.concatenate([part.course for part in parts if part.trial == worst.trial])
    curve = course[:: max(1, len(course) // 60)]
    quiet = [part for part in parts if part not in odd]
    powers = [float(np.mean(part.course[:, 1] ** 2)) for part in quiet]
    half = 1.96 * float(np.sqrt(np.mean(powers or [0.0])))
    total = sum(part.level * part.rows for part in parts)
    share = sum((part.level - usual) * part.rows for part in odd) / total
    names = ", ".join(trials)
    if whole:
        variable = "one_trial"
        words = f"{on} leaves {worst.level / usual:.0f} times the usual power in {names}"
    else:
        variable = "time"
        words = (
            f"{on} changes within {names}: {worst.level / usual:.0f} times the usual power in a part of it"
        )
    band = np.stack([curve[:, 1] - half, curve[:, 1] + half], axis=1)
    return Structure(variable, on, float(np.clip(share, 0.0, 1.0)), curve, band, words)
