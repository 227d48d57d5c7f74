"""Noise from repetition: where the same motion was made twice, the difference of its residuals is noise."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal

from impid_host.diagnosis.rows import Index, Run
from impid_host.effects.view import ANGLE, View
from impid_host.signals.arrays import Floats

_LEAST_S = 5.0
_PAUSE_S = 2.0  # a motion is no repetition of itself a moment before
_ALIKE = 0.02  # rms of the difference of two motions, of the motion's own


@dataclass(frozen=True, slots=True)
class Repeat:
    """Rows of a stretch that another one repeats; differences over sqrt(2) have the noise's own variance.

    Attributes:
        view: of the first; place: rows of the view, (N,); by_family: noise, (N, c).
    """

    view: View
    place: Index
    by_family: dict[str, Floats]


@dataclass(frozen=True, slots=True)
class _Stretch:
    view: View
    place: Index
    step_s: float
    residual: dict[str, Floats]


def repeats(runs: Sequence[Run], views: Sequence[View], base: Floats) -> list[Repeat]:
    """What was repeated within the trials and between trials of one load.

    Args:
        runs: raw rows of the base model alone; base: its parameters.
    """
    parts = list(_stretches(runs, {view.name: view for view in views}, base))
    found = []
    for i, one in enumerate(parts):
        for other in parts[i:]:
            if one.view.load == other.view.load and one.step_s == other.step_s:
                found += _repeat(one, other)
    return found


def _stretches(runs: Sequence[Run], views: dict[str, View], base: Floats) -> Iterator[_Stretch]:
    keys = sorted({(run.trial, run.begin_s) for run in runs if run.family == "torque"})
    for trial, begin in keys:
        own = [r for r in runs if r.trial == trial and r.begin_s == begin and r.family != ANGLE]
        view, step = views[trial], own[0].step_s
        place = np.round((begin + step * np.arange(len(own[0].target))) / view.dt).astype(int)
        residual = {
            family: np.stack(
                [
                    run.target - run.base @ base
                    for run in sorted(own, key=lambda run: run.channel)
                    if run.family == family
                ],
                axis=1,
            )
            for family in {run.family for run in own}
        }
        yield _Stretch(view, place, step, residual)


def _repeat(one: _Stretch, other: _Stretch) -> list[Repeat]:
    a, b = one.view.theta[one.place], other.view.theta[other.place]
    if min(len(a), len(b)) * one.step_s < _LEAST_S:
        return []
    scale = np.std(a, axis=0) + 1e-300
    pairs = [((a - a.mean(0)) / scale)[:, j] for j in range(a.shape[1])]
    others = [((b - a.mean(0)) / scale)[:, j] for j in range(a.shape[1])]
    # Mean squared difference at every lag: where b begins, in rows of a.
    ones_a, ones_b = np.ones(len(a)), np.ones(len(b))
    count = signal.correlate(ones_a, ones_b)
    squares = sum(
        signal.correlate(x**2, ones_b) + signal.correlate(ones_a, y**2) - 2 * signal.correlate(x, y)
        for x, y in zip(pairs, others, strict=True)
    )
    lag = signal.correlation_lags(len(a), len(b))
    seen = count * one.step_s > _LEAST_S
    if one is other:
        seen &= lag * one.step_s > _PAUSE_S
    score = np.where(seen, squares / np.maximum(count, 0.5) / len(pairs), np.inf)
    best = int(np.argmin(score))
    if not score[best] < _ALIKE**2:
        return []
    shift = int(lag[best])
    mine = np.arange(max(shift, 0), min(len(a), len(b) + shift))
    noise = {
        family: (values[mine] - other.residual[family][mine - shift]) / np.sqrt(2.0)
        for family, values in one.residual.items()
        if family in other.residual
    }
    return [Repeat(one.view, one.place[mine], noise)]
