"""Curves over a scheduling variable: values at even knots, cubic between them, smooth by a Gaussian process.

A curve is the spline through its values u at m knots, and u ~ N(0, (amplitude^2) C(length)) with Matern's
kernel of smoothness 5/2 (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 4.17).
The spline carries the curve between knots; no length is below 1.5 of their spacing.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from impid_host.signals.arrays import Floats
from impid_host.signals.spline import Spline

_JITTER = 1e-8
SHORTEST_SPACINGS = 1.5


@dataclass(frozen=True, slots=True)
class Knots:
    """m even knots from `low` to `high` of the scheduling variable."""

    low: float
    high: float
    count: int

    @property
    def shortest(self) -> float:
        """The shortest length of a curve, as a share of the span."""
        return SHORTEST_SPACINGS / (self.count - 1)

    def grid(self, points: int) -> Floats:
        """Even places of the scheduling variable, (points,)."""
        return np.linspace(self.low, self.high, points)

    def weights(self, s: Floats) -> Floats:
        """W (N, m) with curve(s) = W @ u; beyond the ends the curve stands still."""
        places = np.linspace(self.low, self.high, self.count)
        spline = Spline(places, np.eye(self.count))
        result: Floats = spline(np.clip(s, self.low, self.high))
        return result

    def root(self, length: float) -> Floats:
        """L (m, m) with L L' = C; `length` as a share of the span."""
        r = _distances(self.count) / length
        C: Floats = np.asarray((1.0 + r + r**2 / 3.0) * np.exp(-r), dtype=np.float64)
        C.flat[:: self.count + 1] += _JITTER
        return np.asarray(np.linalg.cholesky(C), dtype=np.float64)


@cache
def _distances(count: int) -> Floats:
    places = np.linspace(0.0, np.sqrt(5.0), count)
    return np.asarray(np.abs(places[:, None] - places[None, :]), dtype=np.float64)
