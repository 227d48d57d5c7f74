"""Clocks that start anywhere and run at not quite the right rate."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Clock:
    """A clock that shows `zero_s` at the true time 0 and gains `rate_ppm` microseconds per second.

    True time is counted from the start of the robot's motion.

    Attributes:
        zero_s: what it shows at true time 0.
        rate_ppm: its mean rate against the truth.
        drift_s: what it is ahead by beyond that: drift_s[k] times the Legendre polynomial of degree k + 2
            over the trial.
        wander_ppm, wander_period_s: its rate swings by so much, as the room's temperature does.
        swing_s, swing_period_s, swing_phase_rad: it swings by so much about the straight line that fits best
            over the trial.
        span_s: of the trial.
    """

    zero_s: float
    rate_ppm: float
    drift_s: tuple[float, ...] = ()
    wander_ppm: float = 0.0
    wander_period_s: float = 600.0
    swing_s: float = 0.0
    swing_period_s: float = 30.0
    swing_phase_rad: float = 0.0
    span_s: float = 1.0

    @property
    def rate(self) -> float:
        """Seconds shown per true second, on the mean."""
        return 1.0 + 1e-6 * self.rate_ppm

    def true_time(self, since_zero_s: Array) -> Array:
        """True time at which a steady clock of this rate has advanced by `since_zero_s` beyond `zero_s`.

        It takes the difference, not the reading, so that a clock that has run for days loses no digits.
        """
        return since_zero_s / self.rate

    def ahead(self, true_s: Array) -> Array:
        """By how much the clock is ahead of a steady one of its rate, s."""
        inside = np.clip(true_s, 0.0, self.span_s)
        u = 2.0 * inside / self.span_s - 1.0
        coefficients = np.concatenate([np.zeros(2), np.array(self.drift_s)])
        result = np.polynomial.legendre.legval(u, coefficients)
        if self.wander_ppm:
            omega = 2.0 * np.pi / self.wander_period_s
            result = result + 1e-6 * self.wander_ppm / omega * np.sin(omega * true_s)
        if self.swing_s:
            result = result + self._swing(u)
        return np.asarray(result)

    @property
    def steady(self) -> bool:
        """It keeps its rate."""
        return not (self.drift_s or self.wander_ppm or self.swing_s)

    def _swing(self, u: Array) -> Array:
        """The sine without its constant and its slope: those are zero and rate of any clock."""
        turns = np.pi * self.span_s / self.swing_period_s
        nodes, weights = np.polynomial.legendre.leggauss(64)

        def sine(at: Array) -> Array:
            return np.asarray(self.swing_s * np.sin(turns * (at + 1.0) + self.swing_phase_rad))

        constant = 0.5 * np.sum(weights * sine(nodes))
        slope = 1.5 * np.sum(weights * nodes * sine(nodes))
        return np.asarray(sine(u) - constant - slope * u)
