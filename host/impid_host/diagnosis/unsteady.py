"""A residual much larger in one part of the study than in the rest: an event, a drift, a trial gone wrong.

A noise model common to all trials takes such a part for noise; nothing then stands out in any test that
believes it. So the innovations of each trial's two parts are compared with those of all the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage, stats

from impid_host.diagnosis.result import Structure
from impid_host.diagnosis.rows import Run, Taps
from impid_host.diagnosis.whiten import whitened
from impid_host.effects.view import View
from impid_host.signals.arrays import Floats

_RATIO = 4.0  # of a part's mean squared innovation to the usual, beyond what speed may do to noise
_P_VALUE = 1e-6
_LEAST_ROWS = 25
_SMOOTH_S = 0.5


@dataclass(frozen=True, slots=True)
class _Part:
    """A trial's fit or held-out rows in one channel: mean squared innovation, rows, raw residual (N, 2)."""

    trial: str
    part: str
    level: float
    rows: int
    course: Floats


def unsteady(runs: Sequence[Run], taps: Taps, columns: int, views: Sequence[View]) -> list[Structure]:
    """One entry for each torque channel in which parts of trials stand out.

    Args:
        runs: raw rows of both parts, the effects taken out; their first `columns` are the papers' model.
        views: of the trials; noise may grow with the square of the speed.
    """
    haste = {
        (view.name, joint): v for view in views for joint, v in enumerate(np.mean(view.omega**2, axis=0))
    }
    beta = _fitted(whitened(runs, taps), columns)
    result = []
    for key in sorted({run.key for run in runs if run.family == "torque"}):
        parts = _parts([run for run in runs if run.key == key], taps, beta, columns)
        if len(parts) < 4:
            continue
        usual = float(np.median([part.level for part in parts]))
        typical = float(np.median([haste[part.trial, key[1]] for part in parts]))
        rows = sum(part.rows for part in parts)
        odd = [
            part
            for part in parts
            if part.level > _RATIO * usual * max(1.0, haste[part.trial, key[1]] / max(typical, 1e-300))
            and stats.f.sf(part.level / usual, part.rows / 2, rows / 2) * len(parts) < _P_VALUE
        ]
        if odd:
            result.append(_structure(f"tau{key[1] + 1}", odd, parts, usual))
    return result


def _fitted(runs: Sequence[Run], columns: int) -> Floats:
    fit = [run for run in runs if run.part == "fit"]
    design = np.concatenate([run.design[:, :columns] for run in fit])
    size = np.linalg.norm(design, axis=0) + 1e-300
    target = np.concatenate([run.target for run in fit])
    result: Floats = np.linalg.lstsq(design / size, target, rcond=1e-10)[0] / size
    return result


def _parts(runs: Sequence[Run], taps: Taps, beta: Floats, columns: int) -> list[_Part]:
    squares: dict[tuple[str, str], list[Floats]] = {}
    courses: dict[tuple[str, str], list[Floats]] = {}
    for run in whitened(runs, taps):
        squares.setdefault((run.trial, run.part), []).append(
            (run.target - run.design[:, :columns] @ beta) ** 2
        )
    for run in runs:
        t = run.begin_s + run.step_s * np.arange(len(run.target))
        raw = run.target - run.design[:, :columns] @ beta
        smooth = ndimage.gaussian_filter1d(raw, _SMOOTH_S / run.step_s)
        courses.setdefault((run.trial, run.part), []).append(np.stack([t, smooth], axis=1))
    parts = []
    for (trial, part), values in sorted(squares.items()):
        joined = np.concatenate(values)
        if len(joined) >= _LEAST_ROWS:
            course = np.concatenate(courses[trial, part])
            parts.append(_Part(trial, part, float(np.mean(joined)), len(joined), course))
    return parts


def _structure(on: str, odd: Sequence[_Part], parts: Sequence[_Part], usual: float) -> Structure:
    """Whole trials, or a change within trials; with the course of the trial that stands out most."""
    worst = max(odd, key=lambda part: part.level)
    trials = sorted({part.trial for part in odd})
    whole = all(part in odd for part in parts if part.trial in trials)
    course = np.concatenate([part.course for part in parts if part.trial == worst.trial])
    course = course[np.argsort(course[:, 0])]
    curve = course[:: max(1, len(course) // 60)]
    quiet = [part for part in parts if part not in odd]
    powers = [float(np.mean(part.course[:, 1] ** 2)) for part in quiet]
    half = 1.96 * float(np.sqrt(sum(powers) / max(len(powers), 1)))
    total = sum(part.level * part.rows for part in parts)
    share = 1.0 - sum(min(part.level, usual) * part.rows for part in odd) / total
    share -= sum(part.level * part.rows for part in quiet) / total
    names = ", ".join(trials)
    if whole:
        variable, words = (
            "one_trial",
            f"{on} leaves {worst.level / usual:.0f} times the usual power in {names}",
        )
    else:
        at = float(np.abs(np.diff(course[:, 1])).argmax())
        when = course[int(at), 0]
        variable = "time"
        words = (
            f"{on} changes within {names}: {worst.level / usual:.0f} times the usual power in a part of it, "
            f"steepest near {when:.1f} s of {worst.trial}"
        )
    band = np.stack([curve[:, 1] - half, curve[:, 1] + half], axis=1)
    return Structure(variable, on, float(np.clip(share, 0.0, 1.0)), curve, band, words)
