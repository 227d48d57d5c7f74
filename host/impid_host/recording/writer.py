"""Writes a recording so that nothing older than 100 ms is ever only in memory.

What passes over the wire is collected in chunks of up to 100 ms. Every 20 ms the chunk that still grows
is handed to the operating system as it is, over its own earlier state: killing the program then costs
well below the last 100 ms, and a damaged place one chunk. Once a second a thread syncs the file to the
disk, which bounds what a power cut costs; more often would wear flash cards for no gain on a killed
program."""

import json
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from impid_host import __version__
from impid_host.clock.device import ClockExchange
from impid_host.link.link import Chunk
from impid_host.recording import channels, container
from impid_host.recording.appender import Appender
from impid_host.recording.looks import clock_message, sample_messages, status_message
from impid_host.recording.wire_message import pack
from impid_host.wire.messages import SAMPLE_PERIOD_US
from impid_host.wire.records import BoardStatus, Segment, join_segments
from impid_host.wire.tracker import Position

FLUSH_INTERVAL_S = 0.1  # promised
FLUSH_PERIOD_S = 0.02  # aimed at, so that a busy machine does not break the promise
# The same when much comes at once, as after a stall: a flush that fails or a kill then costs no more.
_FLUSH_SAMPLES = 40
SYNC_INTERVAL_S = 1.0
# What one damaged place costs: a chunk ends when either is reached.
_CHUNK_NS = 100_000_000
_CHUNK_BYTES = 8192
_LOOKS_NS = 1_000_000_000

Metadata = Mapping[str, Mapping[str, str]]


class RecordingWriter:
    """An open recording; `close` it whatever happens.

    `nominal_rate` is the number of board seconds in a host second (1, or the speed of a simulated board); it
    only spaces the plot times of the samples. `carrier` is "serial" or "can".
    """

    def __init__(
        self, file: Appender, metadata: Metadata, *, nominal_rate: float = 1.0, carrier: str = "serial"
    ) -> None:
        self.path = file.path
        self._file = file
        self._carrier = carrier
        self._nominal_rate = nominal_rate
        self._wall_minus_monotonic_ns = time.time_ns() - time.monotonic_ns()
        self._plot_anchors: dict[int, tuple[int, int]] = {}  # run -> log time ns, board time us
        self._flushed_s = self._synced_s = time.monotonic()
        self._unflushed = 0  # samples
        self._sequence: dict[int, int] = {}
        self._next: Position | None = None
        self._looks = _Looks()
        self._changed = True
        self._begin_chunk()
        topics = (channels.WIRES[carrier], channels.EVENTS, *channels.LOOKS)
        self._wire = topics[0]
        self._index = container.Index(
            [container.schema(t.number, t.schema, t.schema_encoding, t.schema_data) for t in topics],
            [container.channel(t.number, t.number, t.name, t.encoding) for t in topics],
        )
        file.write(container.header(channels.PROFILE, f"impid-host {__version__}"))
        for name, values in metadata.items():
            self._metadata(name, values)
        file.write(b"".join([*self._index.schemas, *self._index.channels]))
        self.flush()
        _sync_folder(self.path)

    @classmethod
    def create(
        cls, path: Path, metadata: Metadata, *, nominal_rate: float = 1.0, carrier: str = "serial"
    ) -> Self:
        """Start a new recording file.

        Raises:
            InputError: it exists already, or it cannot be made or written on.
        """
        return cls(Appender.create(path), metadata, nominal_rate=nominal_rate, carrier=carrier)

    def received(self, chunk: Chunk) -> None:
        """Bytes that came in."""
        self._changed = True
        self._make_room(chunk)
        self._received.append(chunk)

    def sent(self, chunk: Chunk) -> None:
        """Bytes that went out."""
        self._changed = True
        self._make_room(chunk)
        self._sent.append(chunk)

    def samples(self, segment: Segment, received_ns: int) -> None:
        """Decoded samples that the chunk of monotonic time `received_ns` completed.

        Their log time is for plotting: board time plus a constant of the run. It is no measurement.
        """
        s = segment.samples
        self._unflushed += len(segment)
        if segment.run not in self._plot_anchors:
            self._plot_anchors[segment.run] = (self._log_time(received_ns), int(s.t_us[0]))
        self._looks.segments.append(segment)
        self._next = Position(
            segment.boot_id, segment.run, int(segment.index[-1]) + 1, int(s.t_us[-1]) + SAMPLE_PERIOD_US
        )

    def status(self, status: BoardStatus, received_ns: int) -> None:
        """A status of the board."""
        self._looks.add(channels.STATUS, self._log_time(received_ns), status_message(status))

    def exchange(self, exchange: ClockExchange, boot_id: int) -> None:
        """A clock exchange, raw."""
        self._changed = True
        self._exchanges.append((exchange, boot_id))
        self._looks.add(channels.CLOCK, self._log_time(exchange.t4_ns), clock_message(exchange, boot_id))

    def event(self, name: str, **detail: Any) -> None:
        """Something that happened, see `channels.EVENT_NAMES`."""
        self._changed = True
        now = Chunk.now(b"")
        body = {"event": name, "monotonic_ns": now.monotonic_ns, "wall_ns": now.wall_ns, "detail": detail}
        self._events.append(
            self._message(channels.EVENTS, self._log_time(now.monotonic_ns), json.dumps(body).encode())
        )

    def flush_when_due(self) -> None:
        """Flush if 20 ms or 40 samples have passed, sync if a second has. To be called every few ms."""
        now = time.monotonic()
        much = self._unflushed >= _FLUSH_SAMPLES * max(1.0, self._nominal_rate)
        if much or now - self._flushed_s >= FLUSH_PERIOD_S:
            self.flush()
        if now - self._synced_s >= SYNC_INTERVAL_S:
            self._file.sync_soon()
            self._synced_s = time.monotonic()

    def flush(self) -> None:
        """Hand everything that came in or went out to the operating system.

        Raises:
            InputError: the disk is full or gone.
        """
        if self._changed:
            chunk = self._chunk()
            self._file.flush(chunk.data if chunk is not None else b"")
            self._changed = False
        self._flushed_s = time.monotonic()
        self._unflushed = 0

    def close(self, summary: Mapping[str, str]) -> None:
        """Write the summary and the index, and close the file.

        Raises:
            InputError: the disk is full or gone; the recording is complete up to the last flush nevertheless.
        """
        try:
            self._end_chunk()
            self._end_looks()
            self._metadata(channels.METADATA_SUMMARY, summary)
            self._file.write(self._index.closing(self._file.tell()))
            self._file.flush()
        finally:
            self._file.close()

    def _begin_chunk(self) -> None:
        self._received: list[Chunk] = []
        self._sent: list[Chunk] = []
        self._exchanges: list[tuple[ClockExchange, int]] = []
        self._events: list[container.Message] = []
        self._began_ns: int | None = None
        self._bytes = 0
        self._position = self._next

    def _make_room(self, chunk: Chunk) -> None:
        """End the chunk of the file that another piece of the wire would make too long."""
        if self._began_ns is not None and (
            chunk.monotonic_ns - self._began_ns >= _CHUNK_NS or self._bytes >= _CHUNK_BYTES
        ):
            self._end_chunk()
            if chunk.monotonic_ns - self._looks.began_ns >= _LOOKS_NS:
                self._end_looks()
                self._looks.began_ns = chunk.monotonic_ns
        if self._began_ns is None:
            self._began_ns = chunk.monotonic_ns
        self._bytes += len(chunk.data)

    def _chunk(self) -> container.Chunk | None:
        """What was collected, as a chunk; None where nothing was."""
        messages = list(self._events)
        passed = [*self._received[:1], *self._sent[:1]]
        if passed or self._exchanges:
            began_ns = min(c.monotonic_ns for c in passed) if passed else self._exchanges[0][0].t4_ns
            data = pack(self._carrier, self._received, self._sent, self._exchanges, self._position)
            number = self._wire.number
            messages.insert(
                0, container.Message(number, self._sequence.get(number, 0), self._log_time(began_ns), data)
            )
        return container.Chunk.of(messages) if messages else None

    def _end_chunk(self) -> None:
        chunk = self._chunk()
        if chunk is not None:
            self._sequence[self._wire.number] = self._sequence.get(self._wire.number, 0) + 1
            self._put(chunk)
        self._begin_chunk()

    def _end_looks(self) -> None:
        """What is for looking, from the last second or so, in a chunk of its own."""
        self._changed = True
        looks, self._looks = self._looks, _Looks()
        messages = [self._message(*each) for each in looks.messages]
        for segment in join_segments(looks.segments):
            for row, data in sample_messages(segment):
                messages.append(self._message(channels.SAMPLES, self._plot_time(segment, row), data))
        if messages:
            self._put(container.Chunk.of(messages))

    def _plot_time(self, segment: Segment, row: int) -> int:
        t_us = int(segment.samples.t_us[row])
        anchor_ns, anchor_us = self._plot_anchors[segment.run]
        return anchor_ns + round((t_us - anchor_us) * 1000 / self._nominal_rate)

    def _put(self, chunk: container.Chunk) -> None:
        self._index.chunk(chunk, self._file.tell())
        self._file.write(chunk.data)

    def _metadata(self, name: str, values: Mapping[str, str]) -> None:
        data = container.metadata(name, values)
        self._index.metadata(name, data, self._file.tell())
        self._file.write(data)

    def _message(self, topic: channels.Topic, at_ns: int, data: bytes) -> container.Message:
        sequence = self._sequence.get(topic.number, 0)
        self._sequence[topic.number] = sequence + 1
        return container.Message(topic.number, sequence, at_ns, data)

    def _log_time(self, monotonic_ns: int) -> int:
        # The wall clock as it stood at the start, carried on by the monotonic one: it may be set meanwhile.
        return monotonic_ns + self._wall_minus_monotonic_ns


class _Looks:
    """What is to be shown of the last second or so."""

    def __init__(self) -> None:
        self.segments: list[Segment] = []
        self.messages: list[tuple[channels.Topic, int, bytes]] = []
        self.began_ns = 0

    def add(self, topic: channels.Topic, at_ns: int, data: bytes) -> None:
        self.messages.append((topic, at_ns, data))


def _sync_folder(path: Path) -> None:
    if os.name != "posix":
        return
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    except OSError:  # some network file systems cannot
        pass
    finally:
        os.close(folder)
