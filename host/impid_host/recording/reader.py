"""Reads a recording, whole or cut off, and decodes its raw bytes anew."""

import base64
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import zstandard
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, Footer, Header, McapRecord, Message, Metadata
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk

from impid_host.clock.device import ClockExchange
from impid_host.errors import InputError
from impid_host.recording import channels
from impid_host.recording.ledger import RunLedger, balance
from impid_host.wire.decoder import LinkCounts, SerialDecoder
from impid_host.wire.messages import SAMPLE_PERIOD_US
from impid_host.wire.records import BoardStatus, Loss, Response, Segment, join_segments

# A chunk holds 100 ms, a few kB; anything far larger is damage and must not fill the memory.
_LARGEST_RECORD_BYTES = 64 << 20
_DAMAGE = (McapError, CRCValidationError, struct.error, UnicodeDecodeError, zstandard.ZstdError)
_PIECE_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class RecordedEvent:
    """An entry of the events channel."""

    name: str
    monotonic_ns: int
    wall_ns: int
    detail: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Recording:
    """What a recording file holds.

    Attributes:
        path: the file.
        metadata: name -> key -> value, as the file has them (host, board, summary).
        segments: samples of each run, decoded from the raw bytes; time is never spliced across them.
        statuses, responses: what the board said.
        exchanges: raw clock exchanges by boot_id.
        events: start, stop, losses, runs.
        counts: frames and samples good, bad and lost.
        ledgers: the books of each run.
        warnings: what is missing or damaged, one sentence each; empty for a whole file.
    """

    path: Path
    metadata: dict[str, dict[str, str]]
    segments: tuple[Segment, ...]
    statuses: tuple[BoardStatus, ...]
    responses: tuple[Response, ...]
    exchanges: dict[int, list[ClockExchange]]
    events: tuple[RecordedEvent, ...]
    counts: LinkCounts
    ledgers: tuple[RunLedger, ...]
    warnings: tuple[str, ...]

    @property
    def duration_s(self) -> float:
        """Board time from first to last sample, summed over the runs, lost samples included."""
        spans = (int(s.samples.t_us[-1]) - int(s.samples.t_us[0]) + SAMPLE_PERIOD_US for s in self.segments)
        return sum(spans) * 1e-6

    @property
    def nominal_rate(self) -> float:
        """Board seconds in a host second: 1, or the speed of a simulated board."""
        return float(self.metadata.get(channels.METADATA_HOST, {}).get("speed", "1"))


def read_recording(path: Path) -> Recording:
    """Read a recording; one that was cut off is read as far as it goes, with a warning.

    Raises:
        InputError: no such file, or not a recording of impid-host.
    """
    contents = _Contents(path)
    for record in _records(path, contents.warnings):
        contents.take(record)
    return contents.decode()


@dataclass(slots=True)
class _Contents:
    """What the records of the file add up to, before the raw bytes are decoded."""

    path: Path
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    raw: bytearray = field(default_factory=bytearray)
    exchanges: dict[int, list[ClockExchange]] = field(default_factory=dict)
    events: list[RecordedEvent] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    _topics: dict[int, str] = field(default_factory=dict)

    def take(self, record: McapRecord) -> None:
        if isinstance(record, Metadata):
            self.metadata[record.name] = dict(record.metadata)
        elif isinstance(record, Channel):
            self._topics[record.id] = record.topic
        elif isinstance(record, Message):
            topic = self._topics.get(record.channel_id)
            try:
                self._take_message(topic, record.data)
            except (ValueError, KeyError, TypeError):
                self.warnings.append(f"{self.path}: a message on {topic} makes no sense and is skipped")

    def _take_message(self, topic: str | None, data: bytes) -> None:
        if topic == channels.RX.name:
            self.raw += base64.b64decode(json.loads(data)["data"], validate=True)
        elif topic == channels.CLOCK.name:
            body = json.loads(data)
            exchange = ClockExchange(*(int(body[key]) for key in ("t1_ns", "t2_us", "t3_us", "t4_ns")))
            self.exchanges.setdefault(int(body["boot_id"]), []).append(exchange)
        elif topic == channels.EVENTS.name:
            body = json.loads(data)
            self.events.append(
                RecordedEvent(
                    body["event"], int(body["monotonic_ns"]), int(body["wall_ns"]), dict(body["detail"])
                )
            )

    def decode(self) -> Recording:
        decoder, raw = SerialDecoder(), bytes(self.raw)
        parts = [decoder.feed(raw[at : at + _PIECE_BYTES]) for at in range(0, len(raw), _PIECE_BYTES)]
        segments = join_segments([segment for part in parts for segment in part.segments])
        statuses = tuple(status for part in parts for status in part.statuses)
        responses = tuple(response for part in parts for response in part.responses)
        losses = [event for part in parts for event in part.events if isinstance(event, Loss)]
        if self.warnings and segments:
            t_us = segments[-1].samples.t_us
            self.warnings.append(
                f"{self.path}: {sum(map(len, segments))} samples could be read, the last run "
                f"up to {(int(t_us[-1]) - int(t_us[0])) * 1e-6:.3f} s after its beginning"
            )
        return Recording(
            path=self.path,
            metadata=self.metadata,
            segments=segments,
            statuses=statuses,
            responses=responses,
            exchanges=self.exchanges,
            events=tuple(self.events),
            counts=decoder.counts,
            ledgers=balance(segments, losses, statuses, responses),
            warnings=tuple(self.warnings),
        )


def _records(path: Path, warnings: list[str]) -> Iterator[McapRecord]:
    """Records in order, chunks opened; damage ends the reading or skips a chunk, and is noted."""
    not_ours = "give a file that `impid-host record` has written"
    try:
        size = path.stat().st_size
        file = path.open("rb")
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the name") from None
    with file:
        reader = StreamReader(file, emit_chunks=True, record_size_limit=_LARGEST_RECORD_BYTES).records
        try:
            header = next(reader)
        except (*_DAMAGE, StopIteration, OSError):
            raise InputError(path, "is not an MCAP file", not_ours) from None
        if not isinstance(header, Header) or header.profile != channels.PROFILE:
            raise InputError(path, "is an MCAP file, but not a recording of impid", not_ours)
        whole, closed = file.tell(), False
        while True:
            try:
                record = next(reader)
            except StopIteration:
                break
            except (*_DAMAGE, OSError, MemoryError):
                break
            whole = file.tell()
            closed = closed or isinstance(record, Footer)
            if not isinstance(record, Chunk):
                yield record
                continue
            try:
                if record.uncompressed_size > _LARGEST_RECORD_BYTES:
                    raise McapError(f"a chunk of {record.uncompressed_size} bytes")
                inside = breakup_chunk(record, validate_crc=True)
            except (*_DAMAGE, MemoryError):
                inside = []
                warnings.append(f"{path}: a chunk before byte {whole} is damaged and is skipped")
            yield from inside
        if not closed:
            warnings.append(
                f"{path}: was cut off (power cut, crash or full disk): up to 0.1 s before its end "
                f"is missing, and {size - whole} of its {size} bytes are an incomplete record"
            )
