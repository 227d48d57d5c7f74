"""Spectral lines in what is left: a disturbance periodic in time belongs to no row of the catalogue."""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage, stats

from impid_host.diagnosis.evidence import solve
from impid_host.diagnosis.result import Structure
from impid_host.diagnosis.rows import Taps
from impid_host.diagnosis.table import Table
from impid_host.signals.arrays import Floats

_P_VALUE = 1e-4
_PADDED = 8192
_NEIGHBOURS_HZ = 1.5
_LEAST_SHARE = 0.05


def spectral_lines(table: Table, active: Sequence[int], taps: Taps) -> list[Structure]:
    """One entry for each torque channel whose residual has a line, common to its trials.

    The noise model may have taken the line for colour, so its gain is undone in the spectrum, and the level
    around a frequency is its neighbours' median.
    """
    columns = table.columns(active)
    beta, _ = solve(table.G, columns)
    result = []
    for key in sorted({run.key for run in table.runs if run.family == "torque"}):
        runs = [run for run in table.runs if run.key == key and len(run.target) > 100]
        if not runs:
            continue
        frequency, power = _power(
            [run.target - run.design[:, columns] @ beta for run in runs], runs[0].step_s
        )
        h = taps[key]
        gain = np.abs(np.exp(-2j * np.pi * np.outer(frequency * runs[0].step_s, np.arange(len(h)))) @ h) ** 2
        power = power / np.maximum(gain, 1e-300)
        entry = _line(f"tau{key[1] + 1}", frequency, power, runs)
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


def _line(on: str, frequency: Floats, power: Floats, runs: Sequence[object]) -> Structure | None:
    span = (frequency > 0.3) & (frequency < 10.0)
    f, p = frequency[span], power[span]
    level = ndimage.median_filter(p, int(2 * _NEIGHBOURS_HZ / (f[1] - f[0])), mode="nearest")
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
