"""Samples at any instants onto one uniform grid; short gaps are bridged, long ones marked, none hidden.

Two logs of one trial rarely have one rate. They meet on the slower: what is faster passes a zero-phase
low-pass below half of that rate first, so that nothing folds.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.filters import FiniteResponse, windowed_sinc
from impid_host.signals.spline import Spline

SHORTEST_S = 2.0
BRIDGED_PERIODS = 5.5
# A spline follows motions of a few hertz across any gap of the shorter, and across none beyond the longer.
_ALWAYS_BRIDGED_S, _NEVER_BRIDGED_S = 5.5e-3, 60e-3
# At least one missing row is bridged at any rate.
_BRIDGED_PERIODS_AT_LEAST = 2.5
# Rates that differ by less are one rate, known with an error.
_SAME_RATE = 0.05
# Half length of the anti-aliasing filter, periods of the slow rate: flat to 0.85 of its half, shut from 1.15.
_FILTER_PERIODS = 16


@dataclass(frozen=True, slots=True)
class Grid:
    """Uniform instants `start_s + k / rate_hz`, k in 0..count-1."""

    start_s: float
    rate_hz: float
    count: int

    @property
    def t(self) -> Floats:
        """The instants, s, shape (count,)."""
        return self.start_s + np.arange(self.count) / self.rate_hz


def nominal_rate(t: Floats) -> float:
    """Sampling rate of stamps with gaps and jitter, Hz; a whole number where it is within 0.1 % of one.

    Raises:
        UndeterminedError: fewer than 100 rows.
    """
    if len(t) < 100:
        raise UndeterminedError(f"only {len(t)} samples; at least 100 are needed")
    steps = np.diff(t)
    periods = np.maximum(np.round(steps / np.median(steps)), 1)
    rate = float(periods.sum() / (t[-1] - t[0]))
    whole = round(rate)
    return float(whole) if whole > 0 and abs(rate / whole - 1) < 1e-3 else rate


def common_grid(start_s: float, end_s: float, rate_hz: float) -> Grid:
    """The grid that fills the stretch from `start_s` to `end_s`.

    Raises:
        UndeterminedError: the stretch is shorter than 2 s.
    """
    if end_s - start_s < SHORTEST_S:
        raise UndeterminedError(
            f"only {max(0.0, end_s - start_s):.2f} s of common data; at least {SHORTEST_S:g} s are needed"
        )
    return Grid(start_s, rate_hz, int((end_s - start_s) * rate_hz + 1e-6) + 1)


def meeting_rate(first_hz: float, second_hz: float) -> float:
    """The rate on which two logs meet, Hz: that of the slower; the first's where they are about the same."""
    return second_hz if second_hz < (1 - _SAME_RATE) * first_hz else first_hz


def oversampling(rate_hz: float, grid_hz: float) -> int:
    """How many times as fast as the grid a signal must be taken before it is thinned to it; at least once."""
    return max(1, int(np.ceil(rate_hz / grid_hz - _SAME_RATE)))


def thinned(values: Floats, factor: int) -> Floats:
    """Every `factor`-th of uniform samples, low-passed first: (N, ...) -> (ceil(N / factor), ...).

    The filter has no phase and is flat up to 0.85 of half the new rate. Beyond the ends values go on by point
    reflection.
    """
    if factor == 1:
        return values
    taps = windowed_sinc(np.kaiser(2 * _FILTER_PERIODS * factor + 1, 8.0), 0.5 / factor)
    beyond = [(_FILTER_PERIODS * factor,) * 2] + [(0, 0)] * (values.ndim - 1)
    longer = np.pad(values, beyond, mode="reflect", reflect_type="odd")
    kept = FiniteResponse.of(taps, factor).apply(longer.reshape(len(longer), -1))
    return kept.reshape(-1, *values.shape[1:])


def _bridged_s(t: Floats) -> float:
    """The longest gap between stamps that is bridged, s."""
    period = float(np.median(np.diff(t)))
    longest = max(_NEVER_BRIDGED_S, _BRIDGED_PERIODS_AT_LEAST * period)
    return float(np.clip(BRIDGED_PERIODS * period, _ALWAYS_BRIDGED_S, longest))


def bridged(t: Floats, usable: Mask, grid: Grid) -> Mask:
    """Grid instants whose usable neighbours in `t` are near enough to interpolate between, shape (count,)."""
    knots = t[usable]
    if len(knots) < 2:
        return np.zeros(grid.count, dtype=bool)
    right = np.clip(np.searchsorted(knots, grid.t), 1, len(knots) - 1)
    near = knots[right] - knots[right - 1] < _bridged_s(t)
    slack = 0.5 / grid.rate_hz
    result: Mask = near & (grid.t >= knots[0] - slack) & (grid.t <= knots[-1] + slack)
    return result


def onto_grid(t: Floats, values: Floats, usable: Mask, grid: Grid) -> Floats:
    """Values (N, k) at times t (N,) on the grid, (count, k): a cubic spline, straight across long gaps.

    A log faster than the grid is taken at a multiple of the grid's rate and thinned. A spline through a long
    gap swings; there the straight line stands in until the mask of `bridged` removes it.
    """
    factor = oversampling(1.0 / float(np.median(np.diff(t))), grid.rate_hz) if len(t) > 1 else 1
    if factor == 1:
        return _interpolated(t, values, usable, grid)
    fine = Grid(grid.start_s, grid.rate_hz * factor, (grid.count - 1) * factor + 1)
    return thinned(_interpolated(t, values, usable, fine), factor)


def _interpolated(t: Floats, values: Floats, usable: Mask, grid: Grid) -> Floats:
    knots, points, instants = t[usable], values[usable], grid.t
    smooth: Floats = Spline(knots, points)(np.clip(instants, knots[0], knots[-1]))
    wide = np.diff(knots) > _bridged_s(t)
    if not wide.any():
        return smooth
    plain = np.stack([np.interp(instants, knots, column) for column in points.T], axis=1)
    place = np.clip(np.searchsorted(knots, instants) - 1, 0, len(knots) - 2)
    beside = wide | np.roll(wide, 1) | np.roll(wide, -1)
    return np.where(beside[place][:, None], plain, smooth)
