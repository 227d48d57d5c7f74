"""The board under test: BENCH commands, time, and what it says unasked."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impid_host.clock.device import ClockExchange
from impid_host.errors import LinkError
from impid_host.link.client import BoardClient
from impid_host.link.link import Chunk
from impid_host.wire.messages import ITEM, RESULT
from impid_host.wire.records import BoardStatus, Decoded

TIMER_HZ = 90e6
SOURCES = {"x": 0, "y": 1, "reference": 2}
BINS = 64
RELEASED = 16  # of BENCH_LEVELS: the inputs are as the settings say
_LOOPING = 0xFFFF_FFFF
_PATIENCE_S = 5.0
_STEP_S = 0.05


@dataclass(frozen=True, slots=True)
class Histogram:
    """Readings of 12 bits by code.

    Attributes:
        codes: every code that has a bin, (64,).
        counts: readings in each bin, (64,).
        outside: readings further away.
    """

    codes: NDArray[np.int64]
    counts: NDArray[np.int64]
    outside: int

    @property
    def mean(self) -> float:
        """Of the codes, without those outside."""
        return float(self.codes @ self.counts / self.counts.sum())

    @property
    def noise(self) -> float:
        """Root mean square about the mean, codes."""
        return float(np.sqrt((self.codes - self.mean) ** 2 @ self.counts / self.counts.sum()))

    @property
    def missing(self) -> int:
        """Empty bins among those within one noise of the mean, which a Gaussian would fill most."""
        near = np.abs(self.codes - self.mean) <= max(self.noise, 0.5)
        return int(np.count_nonzero(self.counts[near] == 0))


class Ear:
    """What passes meanwhile: statuses, samples, clock exchanges."""

    def __init__(self) -> None:
        self.statuses: list[BoardStatus] = []
        self.codes: list[NDArray[np.float64]] = []
        self.exchanges: list[ClockExchange] = []
        self.samples = 0

    def received(self, chunk: Chunk, decoded: Decoded) -> None:  # noqa: ARG002
        """Keeps the latest status and both axes of every sample, (n, 2)."""
        self.statuses = (self.statuses + list(decoded.statuses))[-1:]
        for segment in decoded.segments:
            s = segment.samples
            self.samples += len(s)
            self.codes.append(np.column_stack([s.ax, s.ay]).astype(np.float64))

    def sent(self, chunk: Chunk) -> None:
        """Nothing."""

    def exchanged(self, exchange: ClockExchange, boot_id: int) -> None:  # noqa: ARG002
        """Keeps it."""
        self.exchanges.append(exchange)


class BenchBoard:
    """A board on the bench.

    Args:
        client: the link to it.
        now: seconds of the clock that the link's stamps follow; another than the PC's only in the emulator.
    """

    def __init__(self, client: BoardClient, now: Callable[[], float] = time.monotonic) -> None:
        self.client = client
        self.now = now
        self._listen()

    def _listen(self) -> Ear:
        self.ear = Ear()
        self.client.listener = self.ear
        return self.ear

    def fresh_ear(self) -> Ear:
        """Forgets what passed before."""
        return self._listen()

    @property
    def knows_bench(self) -> bool:
        """Its firmware has BENCH, and its board the pins for it."""
        answer = self.client.answer("BENCH", ITEM["BENCH_COUNT_1"])
        return answer.result == RESULT["OK"]

    def wait(self, seconds: float) -> None:
        """Lets time pass while the link is listened to."""
        end = self.now() + seconds
        while (left := end - self.now()) > 0:
            self.client.pump(min(left, _STEP_S))

    def bench(self, item: str, value: int = 0) -> int:
        """One item of BENCH.

        Raises:
            LinkError: no answer, or the board cannot do that.
        """
        return self.client.request("BENCH", ITEM[f"BENCH_{item}"], value).value

    def count(self, encoder: int) -> int:
        """Counter of encoder 1 or 2 as latched with the last tick, signed."""
        word = self.bench(f"COUNT_{encoder}")
        return word - (1 << 32) if word >> 31 else word

    def code(self, axis: str) -> int:
        """Last conversion of `x` or `y`, 12 bits."""
        return self.bench("CODES") >> (16 if axis == "y" else 0) & 0xFFFF

    def histogram(self, source: str, readings: int) -> Histogram:
        """Counts readings of `x`, `y` (8000 a second) or `reference` (1000 a second).

        Raises:
            LinkError: they do not come.
        """
        self.bench("HISTOGRAM", SOURCES[source] << 16 | readings)
        deadline = self.now() + readings / 1000.0 + _PATIENCE_S
        while self.bench("HISTOGRAM_LEFT"):
            if self.now() > deadline:
                raise LinkError(f"{self.client.name}: readings of {source} do not come; reset the board")
            self.wait(_STEP_S)
        base = self.bench("HISTOGRAM_BASE")
        base -= (1 << 16) if base >> 15 else 0
        counts = [self.bench("HISTOGRAM_BIN", n) for n in range(BINS + 1)]
        return Histogram(base + np.arange(BINS), np.array(counts[:BINS]), counts[BINS])

    def loopback(self, frames: int) -> int:
        """Frames that come back when the CAN controller hears itself.

        Raises:
            LinkError: it does not end.
        """
        self.bench("CAN_LOOPBACK", frames)
        deadline = self.now() + _PATIENCE_S
        while (back := self.bench("CAN_LOOPED")) == _LOOPING:
            if self.now() > deadline:
                raise LinkError(f"{self.client.name}: the CAN loopback does not end; reset the board")
            self.wait(_STEP_S)
        return back

    def await_boot(self, before: int, limit_s: float) -> float | None:
        """Seconds until a status of another boot than `before` comes by itself; None: none comes in time."""
        begun = self.now()
        ear = self.fresh_ear()
        while self.now() - begun < limit_s:
            self.client.pump(_STEP_S)
            if ear.statuses and ear.statuses[-1].boot_id != before:
                return self.now() - begun
        return None
