"""The reflex path of a joint: velocity, late, one direction of stretch, through a muscle.

G h(t) * [v(t - delay)]+ with [.]+ one direction of stretch and h a critically damped low-pass of second
order, the muscle (Kearney, Stein and Parameswaran, IEEE Trans. Biomed. Eng. 44, 1997). One path for `fit` and
for the catalogue's `load.delay`.
"""

import numpy as np

from impid_host.signals.arrays import Floats
from impid_host.signals.recursive import recursive, second_order
from impid_host.signals.spline import Spline

# A spinal stretch reflex of a limb takes some 30 to 80 ms; its muscle acts below some 5 Hz.
DELAY_S = (0.03, 0.08)
CORNER_RAD_S = (4.0, 40.0)
DELAYS_S = tuple(float(d) for d in np.linspace(*DELAY_S, 6))
CORNERS_RAD_S = (5.0, 8.0, 12.0, 18.0, 27.0)


def muscle(stretch: Floats, rate_hz: float, corner_rad_s: float) -> Floats:
    """The critically damped low-pass h, (N, k)."""
    return recursive(second_order(0.5 * corner_rad_s / rate_hz, 1.0)[None], stretch, settled=False)


class ReflexPath:
    """The paths of both directions of stretch of one velocity (N,), at any delay and corner."""

    def __init__(self, velocity: Floats, rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self._t = np.arange(len(velocity)) / rate_hz
        self._late = Spline(self._t, velocity)

    def __call__(self, delay_s: float, corner_rad_s: float) -> Floats:
        """(N, 2): what stretch of positive and of negative velocity makes, gains of 1."""
        late = self._late(np.maximum(self._t - delay_s, 0.0))
        halves = np.stack([np.maximum(late, 0.0), np.minimum(late, 0.0)], axis=1)
        return muscle(halves, self.rate_hz, corner_rad_s)
