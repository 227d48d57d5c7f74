"""Where two logs of one motion look alike: the cross-correlation of their velocities, whatever the offset."""

from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.signals.arrays import Floats
from impid_host.signals.correlation import correlation, overlap_sums
from impid_host.signals.filters import gaussian

MIN_OVERLAP_S = 1.0
# Of a long log so much to either side of the middle is looked at first.
FIRST_HALF_WINDOW_S = 30.0
_COARSE_STEP_S = 5e-3
_MIN_CORRELATION = 0.7
_CANDIDATES = 8


@dataclass(frozen=True, slots=True)
class Motion:
    """One log: times from its first row, s, shape (N,), and angles, shape (N, n)."""

    t: Floats
    theta: Floats

    @property
    def period(self) -> float:
        return float(np.median(np.diff(self.t)))

    @property
    def duration(self) -> float:
        return float(self.t[-1])

    def fewer(self, rows: int) -> "Motion":
        """The same motion by about so many of its rows, at least, or by all."""
        step = max(1, len(self.t) // rows)
        return Motion(self.t[::step], self.theta[::step])


def smallest_step(theta: Floats) -> Floats:
    """Of each angle, (N, n) -> (n,); infinite where it never changes."""
    smallest = []
    for column in np.ascontiguousarray(theta.T):
        steps = np.abs(np.diff(column))
        moved = steps[steps > 1e-12 * max(abs(column.max()), abs(column.min()))]
        smallest.append(moved.min() if len(moved) else np.inf)
    return np.array(smallest)


def _grid_velocity(log: Motion, step: float) -> Floats:
    grid = np.arange(0.0, log.duration, step)
    theta = np.stack([np.interp(grid, log.t, column) for column in log.theta.T], axis=1)
    smooth = gaussian(theta, 2.0)
    return np.gradient(smooth, step, axis=0)


def coarse_lags(device: Motion, robot: Motion) -> list[float]:
    """Lags (s; robot time plus lag = module time) at which the two velocity signals look alike, best first.

    Of a long robot log only the middle is used here: over hours a drift of 200 ppm would smear the peak.
    """
    step = max(_COARSE_STEP_S, device.period, robot.period)
    fast = _grid_velocity(device, step)
    slow = _grid_velocity(robot, step)
    first = max(0, len(slow) // 2 - int(4 * FIRST_HALF_WINDOW_S / step))
    slow = slow[first : len(slow) - first]
    shared = min(len(fast), len(slow))
    needed = max(min(MIN_OVERLAP_S / step, 0.8 * shared), 0.05 * shared)

    fast2, slow2 = (np.sum(velocity**2, axis=1) for velocity in (fast, slow))
    energy = overlap_sums(fast2, len(slow)) * overlap_sums(slow2[::-1], len(fast))
    floor = 1e-6 * fast2.sum() * slow2.sum()
    likeness = np.where(energy > floor, correlation(fast, slow) / np.sqrt(np.maximum(energy, floor)), 0.0)
    likeness[overlap_sums(np.ones(len(fast)), len(slow)) < needed] = 0.0
    left, right = np.concatenate([[0.0], likeness[:-1]]), np.concatenate([likeness[1:], [0.0]])
    peaks = np.flatnonzero((likeness > left) & (likeness >= right) & (likeness > _MIN_CORRELATION))
    if len(peaks) == 0:
        raise UndeterminedError(
            f"module and robot log do not show the same motion (best correlation {likeness.max():.2f}); "
            "check that both belong to one trial, and the encoders' direction and counts_per_rev"
        )
    ranked = peaks[np.argsort(likeness[peaks])[::-1]][:_CANDIDATES]
    return [float((peak - (len(slow) - 1) - first) * step) for peak in ranked]
