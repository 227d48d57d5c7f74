"""Reads a recording, whole or cut off, and decodes its raw bytes anew."""

import base64
import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel, McapRecord, Message, Metadata
from numpy.typing import NDArray

from impid_host.clock.device import ClockExchange
from impid_host.recording import channels
from impid_host.recording.ledger import EndedBoot, RunLedger, balance
from impid_host.recording.records import read_records
from impid_host.wire.can_frames import unpack_frames
from impid_host.wire.carrier import CAN, SERIAL, Carrier
from impid_host.wire.decoder import LinkCounts
from impid_host.wire.messages import SAMPLE_PERIOD_US
from impid_host.wire.records import BoardStatus, Response, Segment, join_segments, until

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
        carrier: "serial" or "can".
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
    carrier: str
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
        return _nominal_rate(self.metadata)


def read_recording(path: Path) -> Recording:
    """Read a recording; one that was cut off is read as far as it goes, with a warning.

    Raises:
        InputError: no such file, or not a recording of impid-host.
    """
    contents = _Contents(path)
    for record in read_records(path, contents.warnings):
        contents.take(record)
    return contents.decode()


def read_raw_can(path: Path) -> tuple[NDArray[np.void], int]:
    """The CAN frames that came in, shape (N,) of CAN_FRAME, and wall minus monotonic clock at the first, ns.

    Raises:
        InputError: no such file, or not a recording of impid-host.
    """
    contents = _Contents(path)
    for record in read_records(path, contents.warnings):
        contents.take(record)
    raw = bytes(contents.raw) if contents.carrier is CAN else b""
    return unpack_frames(raw), contents.wall_minus_monotonic_ns or 0


@dataclass(slots=True)
class _Contents:
    """What the records of the file add up to, before the raw bytes are decoded."""

    path: Path
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    carrier: Carrier = SERIAL
    wall_minus_monotonic_ns: int | None = None
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
        elif topic == channels.CAN_RX.name:
            self.carrier = CAN
            body = json.loads(data)
            self.raw += base64.b64decode(body["data"], validate=True)
            if self.wall_minus_monotonic_ns is None:
                self.wall_minus_monotonic_ns = int(body["wall_ns"]) - int(body["monotonic_ns"])
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
        decoder, raw = self.carrier.decoder(), bytes(self.raw)
        piece = _PIECE_BYTES // self.carrier.piece_bytes * self.carrier.piece_bytes
        parts = [decoder.feed(raw[at : at + piece]) for at in range(0, len(raw), piece)]
        arrived = join_segments([segment for part in parts for segment in part.segments])
        end = self._end()
        segments = tuple(kept for segment in arrived if (kept := until(segment, end)) is not None)
        statuses = tuple(status for part in parts for status in part.statuses)
        responses = tuple(response for part in parts for response in part.responses)
        events = [event for part in parts for event in part.events]
        if self.warnings:
            last = segments[-1].samples.t_us if segments else np.zeros(1, np.uint64)
            self.warnings.append(
                f"{self.path}: {sum(map(len, segments))} samples could be read, the last run "
                f"up to {(int(last[-1]) - int(last[0])) * 1e-6:.3f} s after its beginning"
            )
        return Recording(
            path=self.path,
            carrier=self.carrier.name,
            metadata=self.metadata,
            segments=segments,
            statuses=statuses,
            responses=responses,
            exchanges=self.exchanges,
            events=tuple(self.events),
            counts=decoder.counts,
            ledgers=_without_surplus(
                balance(arrived, events, statuses, responses, self._ended_boots()), segments
            ),
            warnings=tuple(self.warnings),
        )

    def _end(self) -> tuple[int, int] | None:
        """Run and last stamp (us) of the duration that was asked for; None where something else ended it."""
        for event in self.events:
            if event.name == "enough":
                return int(event.detail["run"]), int(event.detail["last_us"])
        return None

    def _ended_boots(self) -> list[EndedBoot]:
        """What is known of the boots that a reset ended, from the notes of the recorder."""
        return [
            EndedBoot(
                boot_id=int(event.detail["before"]),
                produced=event.detail.get("produced"),
                exchanges=tuple(self.exchanges.get(int(event.detail["before"]), ())),
                next_exchanges=tuple(self.exchanges.get(int(event.detail["boot_id"]), ())),
                nominal_rate=_nominal_rate(self.metadata),
            )
            for event in self.events
            if event.name == "boot"
        ]


def _without_surplus(ledgers: tuple[RunLedger, ...], segments: tuple[Segment, ...]) -> tuple[RunLedger, ...]:
    kept = {segment.run: len(segment) for segment in segments}
    return tuple(
        replace(ledger, stored=kept.get(ledger.run, 0), surplus=ledger.stored - kept.get(ledger.run, 0))
        for ledger in ledgers
    )


def _nominal_rate(metadata: dict[str, dict[str, str]]) -> float:
    return float(metadata.get(channels.METADATA_HOST, {}).get("speed", "1"))
