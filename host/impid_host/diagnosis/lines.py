"""Spectral lines in what is left: a disturbance periodic in time belongs to no row of the catalogue."""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage, stats

from impid_host.diagnosis.noise import Taps
from impid_host.diagnosis.result import Structure
from impid_host.diagnosis.rows import Run
from impid_host.diagnosis.table import Table, residuals
from impid_host.signals.arrays import Floats, Mask

_P_VALUE = 1e-4
_PADDED = 8192
_NEIGHBOURS_HZ = 1.5
_LEAST_SHARE = 0.05
_MOVED = 1e-3  # of the largest power of the model's columns


def spectral_lines(table: Table, active: Sequence[int], taps: Taps) -> list[Structure]:
    """One entry for each torque channel whose residual has a line, common to its trials.

    The noise model may have taken the line for colour, so its gain is undone in the spectrum, and the level
    around a frequency is its neighbours' median.
    """
    left = list(zip(table.runs, residuals(table, table.columns(active)), strict=True))
    result = []
    for key in sorted({run.key for run in table.runs if run.family == "torque"}):
        own = [(run, r) for run, r in left if run.key == key and len(r) > 100]
        if not own:
            continue
        runs = [run for run, _ in own]
        frequency, power = _power([r for _, r in own], runs[0].step_s)
        h = taps[key]
        gain = np.abs(np.exp(-2j * np.pi * np.outer(frequency * runs[0].step_s, np.arange(len(h)))) @ h) ** 2
        power = power / np.maximum(gain, 1e-300)
        moves = _moves(runs, frequency)
        entry = _line(f"tau{key[1] + 1}", frequency, np.where(moves, 0.0, power), power, runs)
        if entry is not None:
            result.append(entry)
    return result


def _power(residuals: Sequence[Floats], step_s: float) -> tuple[Floats, Floats]:
    """Frequencies and the sum over trials of periodograms scaled so that a sine shows its mean square."""
    frequency = np.fft.rfftfreq(_PADDED, step_s)
    power = np.zeros(len(frequency))
    for r in residuals:
        window = np.hanning(len(r))
        spectrum = np.fft.rfft(r * window, _PADDED)
        power += 2 * np.abs(spectrum) ** 2 / window.sum() ** 2 / len(residuals)
    return np.asarray(frequency, dtype=np.float64), power


def _moves(runs: Sequence[Run], frequency: Floats) -> Mask:
    """Frequencies at which the robot itself is moved: a line there is the excitation, not hum."""
    power = np.zeros(len(frequency))
    for run in runs:
        window = np.hanning(len(run.base))[:, None]
        power += np.sum(np.abs(np.fft.rfft(run.base * window, _PADDED, axis=0)) ** 2, axis=1)
    return np.asarray(power > _MOVED * power.max())


def _line(
    on: str, frequency: Floats, candidates: Floats, power: Floats, runs: Sequence[Run]
) -> Structure | None:
    span = (frequency > 0.3) & (frequency < 10.0)
    f, p = frequency[span], candidates[span]
    level = ndimage.median_filter(power[span], int(2 * _NEIGHBOURS_HZ / (f[1] - f[0])), mode="nearest")
    count = len(runs)
    # The median of a mean of `count` unit exponentials, by which the level is turned into a mean.
    ratio = p / level * stats.gamma.median(count, scale=1 / count)
    peak = int(np.argmax(ratio))
    independent = len(f) / 60
    chance = float(stats.gamma.sf(ratio[peak], count, scale=1 / count) * independent)
    total = float(np.sum(level) * (f[1] - f[0]) * 30)
    share = float(p[peak] / (p[peak] + total)) if total > 0 else 0.0
    if chance > _P_VALUE or share < _LEAST_SHARE or ratio[peak] < 12:
        return None
    near = np.abs(f - f[peak]) < 0.5
    curve = np.stack([f[near], np.sqrt(2 * p[near])], axis=1)[::4]
    band = np.stack([0 * curve[:, 0], np.sqrt(2 * level[near][::4])], axis=1)
    words = f"{on} has a line at {f[peak]:.3g} Hz, amplitude about {np.sqrt(2 * p[peak]):.2g} N m"
    return Structure("frequency", on, share, curve, band, words)
