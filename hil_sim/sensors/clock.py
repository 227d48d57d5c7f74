"""Clocks that start anywhere and run at not quite the right rate."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Clock:
    """A clock that shows `zero_s` at the true time 0 and gains `rate_ppm` microseconds per second.

    True time is counted from the start of the robot's motion.
    """

    zero_s: float
    rate_ppm: float

    @property
    def rate(self) -> float:
        """Seconds shown per true second."""
        return 1.0 + 1e-6 * self.rate_ppm

    def true_time(self, since_zero_s: Array) -> Array:
        """True time at which the clock has advanced by `since_zero_s` beyond `zero_s`.

        It takes the difference, not the reading, so that a clock that has run for days loses no digits.
        """
        return since_zero_s / self.rate
