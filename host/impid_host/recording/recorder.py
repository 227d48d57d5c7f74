"""One recording session: start the board, store what it sends until enough is there, balance the books."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from math import inf
from typing import Literal

from impid_host.clock.device import EXCHANGE_RATE_HZ, ClockEstimate, ClockExchange, OnlineClock
from impid_host.errors import InputError, LinkError
from impid_host.link.client import BoardClient
from impid_host.link.link import Chunk
from impid_host.recording.writer import RecordingWriter
from impid_host.wire.decoder import LinkCounts
from impid_host.wire.messages import SAMPLE_PERIOD_US
from impid_host.wire.records import BoardStatus, Decoded, Loss

_PUMP_S = 0.02
_REPORT_S = 0.2
_DRAIN_S = 0.5
# STATUS frames come at 10 Hz even from an idle board: a silence this long means that it is gone.
_SILENCE_S = 3.0

Ending = Literal["complete", "interrupted", "disconnected", "disk-full"]


@dataclass(frozen=True, slots=True)
class Progress:
    """Where the recording stands.

    Attributes:
        elapsed_s: board time from the first sample to the last, lost ones included.
        counts: frames and samples so far.
        clock: the clock as known now, or None in the first moments.
    """

    elapsed_s: float
    counts: LinkCounts
    clock: ClockEstimate | None


@dataclass(frozen=True, slots=True)
class Outcome:
    """How the recording ended; `exchanges` are those of the last boot, `status` is the board's last
    word, `trouble` what ended it early."""

    ending: Ending
    progress: Progress
    exchanges: tuple[ClockExchange, ...]
    status: BoardStatus | None
    trouble: str = ""


class Recorder:
    """Stores everything that passes over a client's link; the client's listener."""

    def __init__(self, client: BoardClient, writer: RecordingWriter, *, nominal_rate: float = 1.0) -> None:
        self._client = client
        self._writer = writer
        self._nominal_rate = nominal_rate
        self._clock = OnlineClock(nominal_rate)
        self._clock_boot: int | None = None
        self._exchanges: list[ClockExchange] = []
        self._span_us: dict[int, tuple[int, int]] = {}  # run -> first and last sample
        self._heard_s = time.monotonic()
        self._next_index = 0
        client.listener = self

    def run(
        self,
        duration_s: float,
        *,
        stopped: Callable[[], bool] = lambda: False,
        report: Callable[[Progress], None] = lambda _: None,
    ) -> Outcome:
        """Record until the samples span duration_s of board time, `stopped` says so, or the board is gone.

        With a duration of inf it is complete whenever it is stopped.

        The board is stopped in any case but the last, also when the disk is full.

        Raises:
            LinkError: the board does not start.
        """
        self._client.stop()
        started = self._client.start()
        self._writer.event("start", boot_id=started.boot_id, first_index=started.value)
        trouble, status = "", None
        try:
            done = self._stream(duration_s, stopped, report)
            ending: Ending = "complete" if done or duration_s == inf else "interrupted"
            status = self._finish()
        except LinkError as error:
            ending, trouble = "disconnected", str(error)
            self._writer.event("disconnected", reason=trouble)
        except InputError as error:
            ending, trouble = "disk-full", str(error)
            self._client.mute()
            with suppress(LinkError):
                self._client.stop()
        progress = self._progress()
        report(progress)
        return Outcome(ending, progress, tuple(self._exchanges), status, trouble)

    def received(self, chunk: Chunk, decoded: Decoded) -> None:
        """Store a chunk and what it completed."""
        self._writer.received(chunk)
        for segment in decoded.segments:
            self._writer.samples(segment, chunk.monotonic_ns)
            t_us = segment.samples.t_us
            first, _ = self._span_us.get(segment.run, (int(t_us[0]), 0))
            self._span_us[segment.run] = (first, int(t_us[-1]))
            self._next_index = int(segment.samples.seq[-1]) + 1
        for status in decoded.statuses:
            self._writer.status(status, chunk.monotonic_ns)
        for event in decoded.events:
            self._writer.event("loss" if isinstance(event, Loss) else "run", **asdict(event))
        self._heard_s = time.monotonic()

    def sent(self, chunk: Chunk) -> None:
        """Store what went out."""
        self._writer.sent(chunk)

    def exchanged(self, exchange: ClockExchange, boot_id: int) -> None:
        """Store a clock exchange, and take it into the running estimate."""
        self._writer.exchange(exchange, boot_id)
        if boot_id != self._clock_boot:
            self._clock, self._clock_boot = OnlineClock(self._nominal_rate), boot_id
            self._exchanges.clear()
        self._clock.add(exchange)
        self._exchanges.append(exchange)

    def _stream(
        self, duration_s: float, stopped: Callable[[], bool], report: Callable[[Progress], None]
    ) -> bool:
        """True once there is enough; False when stopped before."""
        ping_s = report_s = self._heard_s = time.monotonic()
        while self._elapsed_s() < duration_s:
            if stopped():
                return False
            self._client.pump(_PUMP_S)
            self._writer.flush_when_due()
            now = time.monotonic()
            if now >= ping_s:
                self._client.ping()
                ping_s = max(ping_s + 1 / EXCHANGE_RATE_HZ, now)
            if now >= report_s:
                report(self._progress())
                report_s = now + _REPORT_S
            if now - self._heard_s > _SILENCE_S:
                raise LinkError(f"nothing heard from the board for {_SILENCE_S:.0f} s; check cable and power")
        return True

    def _finish(self) -> BoardStatus:
        """Stop the board, take what is still on its way, and its last status."""
        stopped = self._client.stop()
        deadline = time.monotonic() + _DRAIN_S
        while self._next_index & 0xFFFFFFFF != stopped.next_index and time.monotonic() < deadline:
            self._client.pump(_PUMP_S)
            self._writer.flush_when_due()
        status = self._client.status()
        self._writer.event("stop", boot_id=stopped.boot_id, produced=stopped.value)
        return status

    def _elapsed_s(self) -> float:
        return sum(last - first + SAMPLE_PERIOD_US for first, last in self._span_us.values()) * 1e-6

    def _progress(self) -> Progress:
        return Progress(self._elapsed_s(), self._client.counts, self._clock.estimate())
