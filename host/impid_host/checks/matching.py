"""Module and controller on one clock without knowing that either counts its angles rightly.

The match of `impid_host.clock.robot` presumes equal angles. Here joints may be swapped, turned, scaled or
relative: every pair of velocities is correlated, whatever its sign and scale, and the lag is taken where the
pairs look most alike together. A few steps of least squares then refine lag and drift.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.signals.arrays import Floats
from impid_host.signals.correlation import correlation, overlap_sums

STEP_S = 0.01
_DRIFT_LIMIT = 1000e-6
# A clock in other units, or one that was labelled with another rate.
TIME_FACTORS = (1e-3, 1e3, 1e-6, 1e6, 0.5, 2.0, 0.1, 10.0, 0.25, 4.0, 0.2, 5.0, 0.8, 1.25, 0.4, 2.5)
ALIKE = 0.8
_LONGEST_S = 2000.0


@dataclass(frozen=True, slots=True)
class Match:
    """t_device = offset + (1 + drift) * factor * t_robot, both from the first row of their logs.

    Attributes:
        likeness: |correlation| of the best pair of velocities at that lag, 0 to 1.
    """

    offset_s: float
    drift: float
    factor: float
    likeness: float

    def to_device(self, t_robot: Floats) -> Floats:
        """Robot times (s from its first row) as module times (s from its first row)."""
        return self.offset_s + (1 + self.drift) * self.factor * t_robot


def match(t_device: Floats, theta_device: Floats, t_robot: Floats, theta_robot: Floats) -> Match:
    """Offset, drift and unit of the robot's clock against the module's; times from each log's first row."""
    ratio = t_device[-1] / max(t_robot[-1], 1e-9)
    # A robot's log may well be longer than the module's, but not a day beside seconds.
    sane = 0.02 < ratio < 50 or t_robot[-1] < _LONGEST_S
    best = _matched(t_device, theta_device, t_robot, theta_robot, 1.0) if sane else Match(0.0, 0.0, 1.0, 0.0)
    if best.likeness >= ALIKE:
        return best
    for factor in TIME_FACTORS:
        if 0.3 < ratio / factor < 3.0:
            other = _matched(t_device, theta_device, t_robot * factor, theta_robot, factor)
            if other.likeness > max(ALIKE, best.likeness + 0.05):
                best = other
    return best


def _matched(
    t_device: Floats, theta_device: Floats, t_robot: Floats, theta_robot: Floats, factor: float
) -> Match:
    if not (1.0 < t_robot[-1] < 2e4 and 1.0 < t_device[-1] < 2e4):
        return Match(0.0, 0.0, factor, 0.0)
    fast, slow = _on_grid(t_device, theta_device), _on_grid(t_robot, theta_robot)
    lag, likeness = _coarse(np.gradient(fast, axis=0), np.gradient(slow, axis=0))
    offset, drift = _refined(fast, slow, lag * STEP_S)
    return Match(offset, drift, factor, likeness)


def _on_grid(t: Floats, theta: Floats) -> Floats:
    """Smoothed over 30 ms, every 10 ms: (T, n)."""
    grid = np.arange(0.0, t[-1], STEP_S)
    values = np.stack([np.interp(grid, t, column) for column in theta.T], axis=1)
    longer = np.pad(values, ((2, 2), (0, 0)), "edge")
    return np.stack([np.convolve(column, _TRIANGLE, "valid") for column in longer.T], axis=1)


_TRIANGLE = np.array([1.0, 2.0, 3.0, 2.0, 1.0]) / 9.0


def _coarse(fast: Floats, slow: Floats) -> tuple[int, float]:
    """Lag in steps (robot plus lag = module) and likeness there."""
    size = len(fast) + len(slow) - 1
    enough = overlap_sums(np.ones(len(fast)), len(slow)) > 0.25 * min(len(fast), len(slow))
    together, single = np.zeros(size), np.zeros(size)
    for column in slow.T:
        energy_slow = overlap_sums(column[::-1] ** 2, len(fast))
        best = np.zeros(size)
        for other in fast.T:
            energy = overlap_sums(other**2, len(slow)) * energy_slow
            floor = 1e-4 * np.sum(other**2) * np.sum(column**2) + 1e-300
            cross = np.abs(correlation(other[:, None], column[:, None]))
            best = np.maximum(best, np.where(enough, cross / np.sqrt(np.maximum(energy, floor)), 0.0))
        together += best
        single = np.maximum(single, best)
    peak = int(np.argmax(together))
    return peak - (len(slow) - 1), float(single[peak])


def _refined(fast: Floats, slow: Floats, offset: float) -> tuple[float, float]:
    """Offset and drift by least squares on the pairs that look alike, scales and zeros free."""
    t: Floats = np.arange(len(slow)).astype(np.float64) * np.float64(STEP_S)
    limit = (len(fast) - 1) * STEP_S
    velocity: Floats = np.gradient(fast, STEP_S, axis=0).astype(np.float64)
    grid: Floats = np.arange(len(fast)).astype(np.float64) * np.float64(STEP_S)
    drift, begin = 0.0, offset
    for _ in range(6):
        at: Floats = offset + (1 + drift) * t
        inside = (at > 0.1) & (at < limit - 0.1)
        if np.count_nonzero(inside) < 100:
            return begin, 0.0
        middle = float(t[inside].mean())
        top, bottom = np.zeros(2), np.zeros((2, 2))
        for column in slow[inside].T:
            pair = _best_pair(grid, fast, velocity, at[inside], t[inside] - middle, column)
            if pair is not None:
                top, bottom = top + pair[0], bottom + pair[1]
        if not np.any(bottom):
            return begin, 0.0
        step = np.linalg.lstsq(bottom, top, rcond=None)[0]
        offset, drift = offset + float(step[0] - step[1] * middle), drift + float(step[1])
        if abs(drift) > _DRIFT_LIMIT or abs(offset - begin) > 0.5:
            return begin, 0.0
        if abs(step[0]) < 1e-7:
            break
    return offset, drift


def _best_pair(
    grid: Floats, fast: Floats, velocity: Floats, at: Floats, elapsed: Floats, column: Floats
) -> tuple[Floats, Floats] | None:
    """Normal equations of (offset, drift) from the module's joint that is most like this one."""
    best: tuple[float, tuple[Floats, Floats]] | None = None
    for angle, speed in zip(fast.T, velocity.T, strict=True):
        a, v = np.interp(at, grid, angle), np.interp(at, grid, speed)
        design = np.stack([a, np.ones_like(a), v, v * elapsed], axis=1)
        if np.ptp(a) == 0:
            continue
        value = np.linalg.lstsq(design, column, rcond=None)[0]
        power = max(float(np.var(column)), 1e-300)
        share = float(np.var(column - design @ value)) / power
        scale = float(value[0])
        if share < 0.05 and abs(scale) > 1e-12 and (best is None or share < best[0]):
            J = design[:, 2:] * scale
            normal: Floats = J.T @ J / power
            best = share, (normal @ (value[2:] / scale), normal)
    return None if best is None else best[1]
