"""Samples at any instants onto one uniform grid; short gaps are bridged, long ones marked, none hidden."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from impid_host.errors import UndeterminedError
from impid_host.signals.arrays import Floats, Mask

BRIDGED_PERIODS = 5.5


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
    if end_s - start_s < 2.0:
        raise UndeterminedError(
            f"only {max(0.0, end_s - start_s):.2f} s of common data; at least 2 s are needed"
        )
    return Grid(start_s, rate_hz, int((end_s - start_s) * rate_hz + 1e-6) + 1)


def bridged(t: Floats, usable: Mask, grid: Grid) -> Mask:
    """Grid instants whose usable neighbours in `t` are at most 5 periods apart, shape (count,)."""
    knots = t[usable]
    if len(knots) < 2:
        return np.zeros(grid.count, dtype=bool)
    right = np.clip(np.searchsorted(knots, grid.t), 1, len(knots) - 1)
    near = (knots[right] - knots[right - 1]) * grid.rate_hz < BRIDGED_PERIODS
    slack = 0.5 / grid.rate_hz
    result: Mask = near & (grid.t >= knots[0] - slack) & (grid.t <= knots[-1] + slack)
    return result


def onto_grid(t: Floats, values: Floats, usable: Mask, grid: Grid) -> Floats:
    """Values (N, k) at times t (N,) on the grid, (count, k): a cubic spline, straight across long gaps.

    A spline through a long gap swings; there the straight line stands in until the mask of `bridged` removes
    it.
    """
    knots, points = t[usable], values[usable]
    smooth: Floats = CubicSpline(knots, points, axis=0)(np.clip(grid.t, knots[0], knots[-1]))
    plain = np.stack([np.interp(grid.t, knots, column) for column in points.T], axis=1)
    wide = np.diff(knots) * grid.rate_hz > BRIDGED_PERIODS
    place = np.clip(np.searchsorted(knots, grid.t) - 1, 0, len(knots) - 2)
    beside = wide | np.roll(wide, 1) | np.roll(wide, -1)
    return np.where(beside[place][:, None], plain, smooth)
