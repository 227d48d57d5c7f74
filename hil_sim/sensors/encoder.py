"""Incremental encoders behind 32-bit counters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EncoderTruth:
    """angle = zero_rad + direction * count * 2 pi / counts_per_rev, joint by joint.

    Attributes:
        counts_per_rev, zero_rad, direction: as the laboratory believes.
        once_per_turn_rad, phase_rad: the disc stands off its centre, reading = q + a sin(q + phase).
        shift_rad: the reading is so much too high.
        factor: true angle over the declared one, both from count 0: real counts per turn are declared ones
            over this.
    """

    counts_per_rev: tuple[float, float]
    zero_rad: tuple[float, float]
    direction: tuple[int, int]
    once_per_turn_rad: tuple[float, float] = (0.0, 0.0)
    phase_rad: tuple[float, float] = (0.0, 0.0)
    shift_rad: tuple[float, float] = (0.0, 0.0)
    factor: tuple[float, float] = (1.0, 1.0)

    def reading(self, q: Array) -> Array:
        """What the joints seem to stand at, before counting, shape (..., 2), rad."""
        error = np.array(self.once_per_turn_rad) * np.sin(q + np.array(self.phase_rad))
        zero = np.array(self.zero_rad)
        return np.asarray(zero + (q + error + np.array(self.shift_rad) - zero) / np.array(self.factor))

    def place_of(self, reading: Array) -> Array:
        """Joint angles at which `reading` (rad) is shown; the inverse of `reading`."""
        q = np.array(reading, dtype=np.float64)
        for _ in range(50):  # contracts by the amplitude and factor, some hundredths
            q += reading - self.reading(q)
        return q

    def count(self, q: Array) -> NDArray[np.int32]:
        """Counter values at joint angles q, shape (n, 2), rad; wraps as a 32-bit counter does."""
        per_rad = np.array(self.direction) * np.array(self.counts_per_rev) / (2.0 * np.pi)
        whole = np.floor((self.reading(q) - np.array(self.zero_rad)) * per_rad + 0.5)
        return np.asarray(whole.astype(np.int64).astype(np.int32))

    def angle(self, count: NDArray[np.int32]) -> Array:
        """Joint angles that counter values stand for, shape (n, 2), rad."""
        per_count = 2.0 * np.pi / (np.array(self.direction) * np.array(self.counts_per_rev))
        return np.asarray(np.array(self.zero_rad) + count * per_count)
