"""Incremental encoders behind 32-bit counters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EncoderTruth:
    """angle = zero_rad + direction * count * 2 pi / counts_per_rev, joint by joint."""

    counts_per_rev: tuple[float, float]
    zero_rad: tuple[float, float]
    direction: tuple[int, int]

    def count(self, q: Array) -> NDArray[np.int32]:
        """Counter values at joint angles q, shape (n, 2), rad; wraps as a 32-bit counter does."""
        per_rad = np.array(self.direction) * np.array(self.counts_per_rev) / (2.0 * np.pi)
        whole = np.floor((q - np.array(self.zero_rad)) * per_rad + 0.5)
        return np.asarray(whole.astype(np.int64).astype(np.int32))

    def angle(self, count: NDArray[np.int32]) -> Array:
        """Joint angles that counter values stand for, shape (n, 2), rad."""
        per_count = 2.0 * np.pi / (np.array(self.direction) * np.array(self.counts_per_rev))
        return np.asarray(np.array(self.zero_rad) + count * per_count)
