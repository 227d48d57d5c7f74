"""Adequacy before belief: a name stands where it took away several times all that is left beside it.

Measured in the band that is reported, in units of the noise: a name that lives on a few fast instants leaves
what a reader looks at as it was.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy import signal

from impid_host.diagnosis.rows import Key, Run
from impid_host.diagnosis.search import RULES
from impid_host.diagnosis.table import Table, residuals
from impid_host.effects.view import ANGLE
from impid_host.signals.arrays import Floats

REPORTED = ("torque", "force", "specific_force")
_ORDER = 5
_NARROWEST = 0.9  # of half the rate of the rows: a wider band is all of it
_FREQUENCIES = 2048


def believable(table: Table, named: Sequence[int], report_hz: float) -> list[int]:
    """The named slots that took away `RULES.takes` times what the names leave, where they show most.

    Of the channels that a name acts on itself: what it changes in others, through a model that fits these
    better, says that something is amiss there and not what. Where more is left there, the name is only what
    the structure resembles. What it took up is left then, and the others are asked again. Structures without
    a name stay out of this: what they take up is left, and a flexible one would take up a name's own part
    with it.

    Args:
        report_hz: the highest frequency that is reported.
    """
    kept = list(named)
    while True:
        left = excess(table, kept, report_hz)
        stand = [s for s in kept if _stands(table, kept, s, left, report_hz)]
        if stand == kept:
            return kept
        kept = stand


def _stands(table: Table, kept: Sequence[int], s: int, left: Mapping[Key, float], report_hz: float) -> bool:
    """Whether a name takes away enough where it acts; one that acts on the angles is not asked.

    Args:
        left: by channel, what all that are kept leave.
    """
    own = table.columns([s])
    acts_on = {run.key for run in table.runs if run.has(own)}
    if any(family == ANGLE for family, _ in acts_on):
        return True
    without = excess(table, [o for o in kept if o != s], report_hz)
    return _taken_over_left(without, {key: left[key] for key in left if key in acts_on}) >= RULES.takes


def _taken_over_left(without: Mapping[Key, float], left: Mapping[Key, float]) -> float:
    """What a name takes away over what all leave, in the channel where it shows most."""
    shown = max(left, key=lambda key: without[key] - left[key], default=None)
    if shown is None:
        return np.inf
    return (without[shown] - left[shown]) / max(left[shown], 1e-9)


def excess(table: Table, slots: Sequence[int], report_hz: float) -> dict[Key, float]:
    """Mean square that a set leaves in each channel in the band, over the noise's own, less one."""
    taps = table.noise.taps
    squares: dict[Key, list[Floats]] = {}
    rates: dict[Key, float] = {}
    for run, innovations in zip(table.runs, residuals(table, table.columns(slots)), strict=True):
        if run.family not in REPORTED:
            continue
        rows = _in_band(run, innovations, taps[run.key], report_hz)
        squares.setdefault(run.key, []).append(rows**2)
        rates[run.key] = 1 / run.step_s
    return {
        key: float(np.mean(np.concatenate(own))) / noise_power(taps[key], rates[key], report_hz) - 1.0
        for key, own in squares.items()
    }


def noise_power(taps: Floats, rate_hz: float, report_hz: float) -> float:
    """Mean square of the noise below `report_hz`, of an autoregression with the given whitening taps."""
    frequency = np.linspace(0.0, 0.5 * rate_hz, _FREQUENCIES)
    density = 2.0 / rate_hz * np.abs(signal.freqz([1.0], taps, worN=frequency, fs=rate_hz)[1]) ** 2
    low = _low_pass(rate_hz, report_hz)
    passed = 1.0 if low is None else np.abs(signal.freqz_sos(low, worN=frequency, fs=rate_hz)[1]) ** 4
    return float(np.trapezoid(density * passed, frequency))


def _in_band(run: Run, innovations: Floats, taps: Floats, report_hz: float) -> Floats:
    """The residual behind its innovations, without its beginning, in the band."""
    rows: Floats = signal.lfilter([1.0], taps, innovations)
    low = _low_pass(1 / run.step_s, report_hz)
    if low is not None and len(rows) > 6 * _ORDER:
        rows = signal.sosfiltfilt(low, rows)
    return rows[len(taps) - 1 :]


def _low_pass(rate_hz: float, report_hz: float) -> Floats | None:
    if report_hz >= _NARROWEST * 0.5 * rate_hz:
        return None
    result: Floats = signal.butter(_ORDER, report_hz, fs=rate_hz, output="sos")
    return result
