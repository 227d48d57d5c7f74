"""A torque that wanders slowly, differently in each trial: noise by its spectrum, but far from any floor.

Told from 1/f noise and from noise with a corner by Whittle's likelihood of the residual's periodograms
(Whittle, J. R. Stat. Soc. B 15, 1953): a random walk falls with the square of frequency down to the lowest.
"""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage, signal

from impid_host.diagnosis.noise import Taps
from impid_host.diagnosis.result import Structure
from impid_host.diagnosis.rows import Run
from impid_host.diagnosis.table import Table, residuals
from impid_host.signals.arrays import Floats

_HIGHEST_HZ = 2.5  # noise of a drive has its corner above; a walk stands out below
_SLOPES = np.arange(0.0, 3.01, 0.1)
_PINK = 1.25  # slopes up to this are taken for 1/f noise
_WALK = 1.5  # least slope of what is called wandering
_CORNER_HZ = 0.3  # noise that is flat below a corner above this is ordinary noise
_DECISIVE = 3.0  # difference of log-likelihoods from 1/f noise at its steepest
_HANN = 1.5  # bins beside each other share so much that they count for less by this
_LEAST_SHARE = 0.15
_SMOOTH_S = 1.0


def wandering(table: Table, active: Sequence[int], taps: Taps) -> list[Structure]:
    """One entry for each torque channel whose residual is a random walk."""
    left = list(zip(table.runs, residuals(table, table.columns(active)), strict=True))
    result = []
    for key in sorted({run.key for run in table.runs if run.family == "torque"}):
        own = [(run, r) for run, r in left if run.key == key and len(r) * run.step_s > 8.0]
        if not own:
            continue
        runs, rows = [run for run, _ in own], [r for _, r in own]
        frequency, power = _periodograms(rows, runs[0].step_s, taps[key])
        found = _walk(frequency, power)
        if found is not None:
            result.append(_structure(f"tau{key[1] + 1}", runs, rows, taps[key], *found))
    return result


def _periodograms(residuals: Sequence[Floats], step_s: float, h: Floats) -> tuple[Floats, Floats]:
    """Frequencies and densities of all stretches one after another, the noise model's gain undone."""
    frequencies, powers = [], []
    for r in residuals:
        window = np.hanning(len(r))
        f = np.fft.rfftfreq(len(r), step_s)
        p = 2 * step_s * np.abs(np.fft.rfft(r * window)) ** 2 / np.sum(window**2)
        gain = np.abs(np.exp(-2j * np.pi * np.outer(f * step_s, np.arange(len(h)))) @ h) ** 2
        span = (f > 1.5 * f[1]) & (f < _HIGHEST_HZ)
        frequencies.append(f[span])
        powers.append(p[span] / np.maximum(gain[span], 1e-300))
    return np.concatenate(frequencies), np.concatenate(powers)


def _walk(f: Floats, p: Floats) -> tuple[float, float] | None:
    """Slope and share of power of a random walk in the spectrum, or None."""
    best = [_whittle(p, f**-slope) for slope in _SLOPES]
    costs = np.array([cost for cost, _, _ in best])
    winner = int(np.argmin(costs))
    pink = costs[_SLOPES <= _PINK].min()
    cornered = min(_whittle(p, 1 / (1 + (f / corner) ** 2))[0] for corner in np.geomspace(_CORNER_HZ, 6, 9))
    if _SLOPES[winner] < _WALK or (min(pink, cornered) - costs[winner]) / _HANN < _DECISIVE:
        return None
    _, level, slow = best[winner]
    part = float(np.mean(slow * f ** -_SLOPES[winner]))
    share = part / (part + level)
    return (float(_SLOPES[winner]), share) if share > _LEAST_SHARE else None


def _whittle(p: Floats, shape: Floats) -> tuple[float, float, float]:
    """Least cost sum(log S + p / S) over S = level + slow * shape, and these two."""
    ratios = np.concatenate([[0.0], np.geomspace(1e-3, 1e4, 71)]) / np.median(shape)
    S = 1 + ratios[:, None] * shape
    level = np.mean(p / S, axis=1)
    cost = np.sum(np.log(S), axis=1) + len(p) * np.log(level)
    at = int(np.argmin(cost))
    return float(cost[at]), float(level[at]), float(level[at] * ratios[at])


def _structure(
    on: str, runs: Sequence[Run], residuals: Sequence[Floats], h: Floats, slope: float, share: float
) -> Structure:
    """With the course of the trial that wanders farthest."""
    courses = []
    for run, r in zip(runs, residuals, strict=True):
        course = ndimage.gaussian_filter1d(_coloured(r, h), _SMOOTH_S / run.step_s)
        courses.append(np.stack([run.begin_s + run.step_s * np.arange(len(r)), course], axis=1))
    farthest = int(np.argmax([np.ptp(course[:, 1]) for course in courses]))
    curve = courses[farthest][:: max(1, round(0.5 / runs[0].step_s))]
    size = float(np.ptp(curve[:, 1]))
    half = 1.96 * np.std(_coloured(residuals[farthest], h) - courses[farthest][:, 1])
    half /= np.sqrt(2 * np.sqrt(np.pi) * _SMOOTH_S / runs[0].step_s)
    words = (
        f"{on} wanders slowly, in each trial otherwise, like a random walk (power falls with f to the "
        f"{slope:.1f}); by {size:.2g} in {runs[farthest].trial}"
    )
    band = np.stack([curve[:, 1] - half, curve[:, 1] + half], axis=1)
    return Structure("time", on, share, curve, band, words)


def _coloured(r: Floats, h: Floats) -> Floats:
    """What the noise model whitened, as it was: r divided by the polynomial h."""
    result: Floats = signal.lfilter([1.0], h, r)
    return result
