"""Writes a recording so that nothing older than 100 ms is ever only in memory.

Every 20 ms the current MCAP chunk is finished and handed to the operating system: killing the program
then costs well below the last 100 ms. Once a second a thread syncs the file to the disk, which bounds what a
power cut costs; more often would wear flash cards for no gain on a killed program.
"""

import base64
import json
import os
import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

from mcap.writer import CompressionType, Writer

from impid_host import __version__
from impid_host.clock.device import ClockExchange
from impid_host.link.link import Chunk
from impid_host.recording import channels
from impid_host.recording.appender import Appender
from impid_host.wire.records import BoardStatus, Segment

FLUSH_INTERVAL_S = 0.1  # promised
FLUSH_PERIOD_S = (
    0.02  # aimed at, so that a busy machine does not break the promise; 17 % more file than 50 ms
)
# The same when much comes at once, as after a stall: a flush that fails or a kill then costs no more.
_FLUSH_SAMPLES = 40
SYNC_INTERVAL_S = 1.0
# Chunks end with a flush; this only bounds memory should flushes come late.
_CHUNK_BYTES = 4 << 20

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
        self._nominal_rate = nominal_rate
        self._wall_minus_monotonic_ns = time.time_ns() - time.monotonic_ns()
        self._plot_anchor: tuple[int, int, int] | None = None  # run, log time ns, board time us
        self._flushed_s = self._synced_s = time.monotonic()
        self._unflushed = 0  # samples
        self._mcap = Writer(file, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        self._mcap.start(profile=channels.PROFILE, library=f"impid-host {__version__}")
        for name, values in metadata.items():
            self._mcap.add_metadata(name, dict(values))
        schemas: dict[str, int] = {}
        self._channel: dict[str, int] = {}
        self._rx, self._tx = channels.WIRES[carrier]
        for topic in (self._rx, self._tx, *channels.DECODED):
            if topic.schema not in schemas:
                schemas[topic.schema] = self._mcap.register_schema(
                    topic.schema, "jsonschema", topic.schema_json()
                )
            self._channel[topic.name] = self._mcap.register_channel(topic.name, "json", schemas[topic.schema])
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
        self._wire(self._rx, chunk)

    def sent(self, chunk: Chunk) -> None:
        """Bytes that went out."""
        self._wire(self._tx, chunk)

    def samples(self, segment: Segment, received_ns: int) -> None:
        """Decoded samples, one message each, that the chunk of monotonic time `received_ns` completed.

        Their log time is for plotting: board time plus a constant of the run. It is no measurement.
        """
        s = segment.samples
        self._unflushed += len(segment)
        first_us = int(s.t_us[0])
        if self._plot_anchor is None or self._plot_anchor[0] != segment.run:
            self._plot_anchor = (segment.run, self._log_time(received_ns), first_us)
        _, anchor_ns, anchor_us = self._plot_anchor
        ns_per_us = 1000 / self._nominal_rate
        channel = self._channel[channels.SAMPLES.name]
        head = f'{{"boot_id":{segment.boot_id},"run":{segment.run},"index":'
        columns = (segment.index, s.t_us, s.ax, s.ay, s.enc1, s.enc2, s.flags)
        third = [""] * len(s) if s.az is None else [f'"az":{az},' for az in s.az.tolist()]
        for index, t_us, ax, ay, enc1, enc2, flags, az in zip(
            *(c.tolist() for c in columns), third, strict=True
        ):
            text = (
                f'{head}{index},"t_us":{t_us},"ax":{ax},"ay":{ay},{az}'
                f'"enc1":{enc1},"enc2":{enc2},"flags":{flags}}}'
            )
            at = anchor_ns + round((t_us - anchor_us) * ns_per_us)
            self._mcap.add_message(channel, at, text.encode(), at, index & 0xFFFFFFFF)

    def status(self, status: BoardStatus, received_ns: int) -> None:
        """A status of the board."""
        counted = {name: value for name, value in asdict(status).items() if value is not None}
        self._json(channels.STATUS, received_ns, counted)

    def exchange(self, exchange: ClockExchange, boot_id: int) -> None:
        """A clock exchange, raw."""
        self._json(channels.CLOCK, exchange.t4_ns, {"boot_id": boot_id, **asdict(exchange)})

    def event(self, name: str, **detail: Any) -> None:
        """Something that happened, see `channels.EVENT_NAMES`."""
        now = Chunk.now(b"")
        body = {"event": name, "monotonic_ns": now.monotonic_ns, "wall_ns": now.wall_ns, "detail": detail}
        self._json(channels.EVENTS, now.monotonic_ns, body)

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
        """Finish the chunk and hand it to the operating system.

        Raises:
            InputError: the disk is full or gone.
        """
        self._mcap.flush()  # type: ignore[no-untyped-call]
        self._flushed_s = time.monotonic()
        self._unflushed = 0

    def close(self, summary: Mapping[str, str]) -> None:
        """Write the summary and the index, and close the file.

        Raises:
            InputError: the disk is full or gone; the recording is complete up to the last flush nevertheless.
        """
        try:
            self._mcap.add_metadata(channels.METADATA_SUMMARY, dict(summary))
            self._mcap.finish()  # type: ignore[no-untyped-call]
            self._file.flush()
        finally:
            self._file.close()

    def _wire(self, topic: channels.Topic, chunk: Chunk) -> None:
        data = base64.b64encode(chunk.data).decode("ascii")
        body = {"monotonic_ns": chunk.monotonic_ns, "wall_ns": chunk.wall_ns, "data": data}
        self._json(topic, chunk.monotonic_ns, body)

    def _json(self, topic: channels.Topic, monotonic_ns: int, body: Mapping[str, Any]) -> None:
        at = self._log_time(monotonic_ns)
        self._mcap.add_message(self._channel[topic.name], at, json.dumps(body).encode(), at)

    def _log_time(self, monotonic_ns: int) -> int:
        # The wall clock as it stood at the start, carried on by the monotonic one: it may be set meanwhile.
        return monotonic_ns + self._wall_minus_monotonic_ns


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
