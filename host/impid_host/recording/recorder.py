"""One recording session: start the board, store what it sends until enough is there, balance the books.

A board that is reset goes on in a run of its own. A link that breaks is opened again; what the board took
meanwhile is counted as lost by the index. Nothing is ever joined across either.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from math import inf
from typing import Any, Literal, Protocol

from impid_host.clock import device
from impid_host.clock.device import EXCHANGE_RATE_HZ, ClockEstimate, ClockExchange, OnlineClock
from impid_host.errors import InputError, LinkError
from impid_host.link.client import BoardClient
from impid_host.link.link import Chunk, Link
from impid_host.recording.watch import BoardWatch, WallClockWatch
from impid_host.recording.writer import RecordingWriter
from impid_host.wire.decoder import LinkCounts
from impid_host.wire.messages import SAMPLE_PERIOD_US
from impid_host.wire.records import BoardStatus, Decoded, Loss, Response, until

_PUMP_S = 0.02
_REPORT_S = 0.2
_DRAIN_S = 0.5
# STATUS frames come at 10 Hz even from an idle board: a silence this long means that the link is dead.
SILENCE_S = 1.0
# Time in which this program itself did not run is no silence: what came meanwhile may wait to be read.
_LISTENED_AT_MOST_S = 2 * _PUMP_S
_RETRY_S = 0.1

Ending = Literal["complete", "interrupted", "disconnected", "disk-full"]


@dataclass(frozen=True, slots=True)
class Progress:
    """Where the recording stands.

    Attributes:
        elapsed_s: board time from the first sample to the last of each run, lost ones included.
        counts: frames and samples so far.
        clock: the clock as known now, or None while it is not determined.
        connected: whether the board can be reached.
    """

    elapsed_s: float
    counts: LinkCounts
    clock: ClockEstimate | None
    connected: bool = True


@dataclass(frozen=True, slots=True)
class Outcome:
    """How the recording ended; `exchanges` are those of the last boot, `status` is the board's last
    word, `trouble` what ended it early; after a full disk, `progress` is what had arrived by then."""

    ending: Ending
    progress: Progress
    exchanges: tuple[ClockExchange, ...]
    status: BoardStatus | None
    trouble: str = ""


class Onlooker(Protocol):
    """Who may look at the decoded stream while it is stored, and must not hold it up."""

    def see(self, decoded: Decoded) -> None:
        """What a chunk completed."""


class Recorder:
    """Stores everything that passes over a client's link; the client's listener.

    Args:
        client: over an open link.
        writer: the file.
        nominal_rate: board seconds in a host second.
        open_link: opens the client's link again; None: a broken link is the end.
        patience_s: how long a board that is gone is waited for.
        onlooker: sees what is stored.
        silence_s: a link that brings nothing for so long is taken for dead.
    """

    def __init__(
        self,
        client: BoardClient,
        writer: RecordingWriter,
        *,
        nominal_rate: float = 1.0,
        open_link: Callable[[], Link] | None = None,
        patience_s: float = 0.0,
        onlooker: Onlooker | None = None,
        silence_s: float = SILENCE_S,
    ) -> None:
        self._client = client
        self._writer = writer
        self._nominal_rate = nominal_rate
        self._open_link = open_link
        self._patience_s = patience_s if open_link is not None else 0.0
        self._onlooker = onlooker
        self._silence_s = silence_s / min(1.0, nominal_rate)
        self._board = BoardWatch()
        self._wall = WallClockWatch()
        self._clock = OnlineClock(nominal_rate)
        self._clock_boot: int | None = None
        self._exchanges: list[ClockExchange] = []
        self._unplaced: list[tuple[ClockExchange, int]] = []  # of a boot that no sample has confirmed yet
        self._span_us: dict[int, tuple[int, int]] = {}  # run -> first and last sample
        self._quiet_s = 0.0
        self._next_index = 0
        self._duration_s = inf
        self._enough: tuple[int, int] | None = None  # run, and the last stamp that belongs to the recording
        self._connected = True
        device.load()
        client.listener = self

    def run(
        self,
        duration_s: float,
        *,
        stopped: Callable[[], bool] = lambda: False,
        report: Callable[[Progress], None] = lambda _: None,
    ) -> Outcome:
        """Record until the samples span duration_s of board time, `stopped` says so, or the board stays away.

        With a duration of inf it is complete whenever it is stopped. The board is stopped if it can be
        reached, also when the disk is full. What it sends until it has stopped, and what a busy machine takes
        in late, is kept among the raw bytes and marked as coming after the end.

        Raises:
            LinkError: the board does not start.
        """
        self._duration_s = duration_s
        trouble, status, arrived, started = "", None, None, False
        try:
            self._client.stop()
            self._start()
            started = True
            done = self._stream(duration_s, stopped, report)
            ending: Ending = "complete" if done or duration_s == inf else "interrupted"
            if self._connected:
                status = self._finish(report)
        except LinkError as error:
            if not started:
                raise
            ending, trouble = "disconnected", str(error)
            if self._connected:
                self.note("disconnected", reason=trouble)
        except InputError as error:
            ending, trouble, arrived = "disk-full", str(error), self._progress()
            self._client.mute()
            with suppress(LinkError):
                self._client.stop()
        progress = arrived or self._progress()
        report(progress)
        return Outcome(ending, progress, tuple(self._exchanges), status, trouble)

    def note(self, event: str, **detail: Any) -> None:
        """Write an event into the recording."""
        self._writer.event(event, **detail)

    def received(self, chunk: Chunk, decoded: Decoded) -> None:
        """Store a chunk and what it completed."""
        self._quiet_s = 0.0
        self._writer.received(chunk)
        jump_s = self._wall.jump_s(chunk)
        if jump_s is not None:
            self.note("wall-clock-set", by_s=jump_s)
        for segment in decoded.segments:
            t_us = segment.samples.t_us
            first, _ = self._span_us.get(segment.run, (int(t_us[0]), 0))
            self._span_us[segment.run] = (first, int(t_us[-1]))
            self._see_the_end(segment.run)
            wanted = until(segment, self._enough)
            if wanted is not None:
                self._writer.samples(wanted, chunk.monotonic_ns)
            self._next_index = int(segment.samples.seq[-1]) + 1
            self._place_exchanges(segment.boot_id)
        for status in decoded.statuses:
            self._writer.status(status, chunk.monotonic_ns)
            self._board.see(status)
        for event in decoded.events:
            self.note("loss" if isinstance(event, Loss) else "run", **asdict(event))
        if self._onlooker is not None:
            self._onlooker.see(decoded)
        self._writer.flush_when_due()  # here, so that what comes while an answer is awaited is safe as well

    def _see_the_end(self, run: int) -> None:
        """Note once where the duration ends: the last sample that belongs to it."""
        surplus_us = (self._elapsed_s() - self._duration_s) * 1e6
        if self._enough is None and surplus_us >= 0:
            self._enough = (run, self._span_us[run][1] - round(surplus_us))
            self.note("enough", run=run, last_us=self._enough[1])

    def sent(self, chunk: Chunk) -> None:
        """Store what went out."""
        self._writer.sent(chunk)

    def exchanged(self, exchange: ClockExchange, boot_id: int) -> None:
        """Keep a clock exchange until a sample tells its boot: on CAN the answer itself does not."""
        self._unplaced.append((exchange, boot_id))

    def _place_exchanges(self, sample_boot: int) -> None:
        for exchange, boot_id in self._unplaced:
            if boot_id != sample_boot:
                continue
            self._writer.exchange(exchange, boot_id)
            if boot_id != self._clock_boot:
                self._clock, self._clock_boot = OnlineClock(self._nominal_rate), boot_id
                self._exchanges.clear()
            self._clock.add(exchange)
            self._exchanges.append(exchange)
        self._unplaced.clear()

    def _stream(
        self, duration_s: float, stopped: Callable[[], bool], report: Callable[[Progress], None]
    ) -> bool:
        """True once there is enough; False when stopped before."""
        ping_s = report_s = time.monotonic()
        while self._elapsed_s() < duration_s:
            if stopped():
                return False
            now = time.monotonic()
            if now >= report_s:
                report(self._progress())
                report_s = now + _REPORT_S
            try:
                if now >= ping_s:
                    self._client.ping()
                    ping_s = max(ping_s + 1 / EXCHANGE_RATE_HZ, now)
                self._listen()
                if self._board.must_be_started:
                    self._start_again()
            except LinkError as error:
                if not self._reconnect(error, stopped, report):
                    return False
            self._writer.flush_when_due()
        return True

    def _listen(self) -> None:
        began = time.monotonic()
        if not self._client.pump(_PUMP_S):
            self._quiet_s += min(time.monotonic() - began, _LISTENED_AT_MOST_S)
        if self._quiet_s > self._silence_s:
            raise LinkError(
                f"{self._client.name}: nothing heard from the board for {self._silence_s:.0f} s; "
                "check cable and power"
            )

    def _start(self) -> None:
        started = self._client.start()
        self._board.started()
        self.note("start", boot_id=started.boot_id, first_index=started.value)

    def _start_again(self) -> None:
        """The board says that it does not stream: it has been reset, or somebody has stopped it."""
        self._meet_again()
        self._start()

    def _meet_again(self) -> None:
        """See to it that this is the same board, and note it where it has been reset."""
        now = self._client.identity()
        before = self._board.identity
        if before is not None and now.uid != before.uid:
            raise LinkError(f"{self._client.name}: another board answers; connect the one that was recorded")
        if before is not None and now.boot_id != before.boot_id:
            last = self._client.last_stream()
            counted = {"produced": last.produced} if last and last.boot_id == before.boot_id else {}
            self.note(
                "boot", before=before.boot_id, boot_id=now.boot_id, reset_cause=now.reset_cause, **counted
            )
        self._board.identity = now

    def _reconnect(
        self, error: LinkError, stopped: Callable[[], bool], report: Callable[[Progress], None]
    ) -> bool:
        """Open the link again and see to it that the board streams; False when stopped meanwhile.

        Raises:
            LinkError: the board did not come back in time.
        """
        began = time.monotonic()
        self.note("disconnected", reason=str(error))
        self._connected = False
        while time.monotonic() - began < self._patience_s:
            report(self._progress())
            self._writer.flush_when_due()
            if stopped():
                return False
            try:
                assert self._open_link is not None
                self._client.reconnect(self._open_link)
                now = self._client.identity()
                if now != self._board.identity or not self._client.streaming():
                    self._start_again()
            except LinkError:
                time.sleep(_RETRY_S)
                continue
            self._connected, self._quiet_s = True, 0.0
            self.note("reconnected", boot_id=now.boot_id, after_s=round(time.monotonic() - began, 3))
            return True
        raise error

    def identify(self) -> None:
        """Learn which board this is, so that no other is ever taken for it.

        Raises:
            LinkError: no answer.
        """
        self._board.identity = self._client.identity()

    def _finish(self, report: Callable[[Progress], None]) -> BoardStatus:
        """Stop the board, take what is still on its way, and its last status."""
        stopped = self._stop_patiently(report)
        deadline = time.monotonic() + _DRAIN_S
        while self._next_index & 0xFFFFFFFF != stopped.next_index and time.monotonic() < deadline:
            self._client.pump(_PUMP_S)
            self._writer.flush_when_due()
        status = self._client.status()
        self.note("stop", boot_id=stopped.boot_id, produced=stopped.value)
        return status

    def _stop_patiently(self, report: Callable[[Progress], None]) -> Response:
        """Its count closes the books: a board that is gone or silent is waited for as for its samples.

        Raises:
            LinkError: it did not come back in time.
        """
        began = time.monotonic()
        while True:
            try:
                return self._client.stop()
            except LinkError as error:
                if time.monotonic() - began >= max(self._patience_s, self._silence_s):
                    raise
                if self._patience_s == 0.0 or self._open_link is None:
                    continue  # what cannot be opened again is asked again
                self.note("disconnected", reason=str(error))
            report(self._progress())
            with suppress(LinkError):
                self._client.reconnect(self._open_link)
                self._meet_again()
                self.note("reconnected", after_s=round(time.monotonic() - began, 3))
            self._writer.flush_when_due()
            time.sleep(_RETRY_S)

    def _elapsed_s(self) -> float:
        return sum(last - first + SAMPLE_PERIOD_US for first, last in self._span_us.values()) * 1e-6

    def _progress(self) -> Progress:
        return Progress(self._elapsed_s(), self._client.counts, self._clock.estimate(), self._connected)
