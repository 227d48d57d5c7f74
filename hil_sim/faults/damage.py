"""Damage to a stream of bytes: each kind takes bytes, gives bytes, and counts what it did."""

from typing import Protocol

import numpy as np

from hil_sim.faults.chance import RareEvents

BITS = 8


class Damage(Protocol):
    """One kind of damage on one direction of a line."""

    def __call__(self, data: bytes) -> bytes:
        """The bytes as they arrive."""

    @property
    def count(self) -> int:
        """How many times it struck."""


class FlippedBits:
    """Implements `Damage`: single bits arrive inverted; `rate` is per bit."""

    def __init__(self, rate: float, generator: np.random.Generator) -> None:
        self._events = RareEvents(rate, generator)
        self.count = 0

    def __call__(self, data: bytes) -> bytes:
        """The bytes as they arrive."""
        hits = self._events.within(BITS * len(data))
        damaged = bytearray(data)
        for hit in hits.tolist():
            damaged[hit // BITS] ^= 1 << hit % BITS
        self.count += hits.size
        return bytes(damaged)


class DroppedBytes:
    """Implements `Damage`: single bytes do not arrive; `rate` is per byte."""

    def __init__(self, rate: float, generator: np.random.Generator) -> None:
        self._events = RareEvents(rate, generator)
        self.count = 0

    def __call__(self, data: bytes) -> bytes:
        """The bytes as they arrive."""
        hits = self._events.within(len(data))
        self.count += hits.size
        return np.delete(np.frombuffer(data, np.uint8), hits).tobytes()


class DuplicatedBytes:
    """Implements `Damage`: single bytes arrive twice; `rate` is per byte."""

    def __init__(self, rate: float, generator: np.random.Generator) -> None:
        self._events = RareEvents(rate, generator)
        self.count = 0

    def __call__(self, data: bytes) -> bytes:
        """The bytes as they arrive."""
        hits = self._events.within(len(data))
        self.count += hits.size
        plain = np.frombuffer(data, np.uint8)
        return np.insert(plain, hits, plain[hits]).tobytes()
