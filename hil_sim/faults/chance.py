"""Chance events along a stream, the same however the stream is cut into pieces."""

import numpy as np
from numpy.typing import NDArray


class RareEvents:
    """Bernoulli trials with probability `rate`, drawn as the geometric gaps between successes."""

    def __init__(self, rate: float, generator: np.random.Generator) -> None:
        self._rate = rate
        self._generator = generator
        self._next = self._gap() - 1  # trials until the next success

    def within(self, trials: int) -> NDArray[np.int64]:
        """Which of the next `trials` trials succeed; ascending, counted from 0."""
        hits = []
        while self._next < trials:
            hits.append(self._next)
            self._next += self._gap()
        self._next -= trials
        return np.array(hits, dtype=np.int64)

    def _gap(self) -> int:
        return int(self._generator.geometric(self._rate))
