"""Reads a recording, whole or cut off, and decodes its raw bytes anew.

One pass in pieces: `read_recording` keeps the samples, `survey` what can be said without them,
`sample_pieces` hands them on. A file of a day takes no more memory than what is kept."""

import base64
import json
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impid_host.clock.device import ClockExchange, Exchanges
from impid_host.errors import InputError
from impid_host.recording import channels
from impid_host.recording.ledger import TOLD, EndedBoot, RunLedger, balance, told_by
from impid_host.recording.records import Message, Metadata, Window, open_records
from impid_host.recording.runs import Run, duration_s
from impid_host.recording.wire_message import unpack
from impid_host.samples import DeviceSamples
from impid_host.wire.can_frames import unpack_frames
from impid_host.wire.carrier import CAN, SERIAL, Carrier, Decoder
from impid_host.wire.decoder import LinkCounts
from impid_host.wire.records import BoardStatus, Decoded, Loss, NewRun, Response, Segment, since
from impid_host.wire.statuses import Statuses
from impid_host.wire.tracker import Position

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
        segments: samples of each run, decoded from the raw bytes; time is never spliced across them. Empty in
            a survey.
        runs: what can be said of each run without its samples.
        statuses, responses: what the board said; of the statuses, a survey has the last.
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
    runs: tuple[Run, ...]
    statuses: Sequence[BoardStatus]
    responses: tuple[Response, ...]
    exchanges: dict[int, Sequence[ClockExchange]]
    events: tuple[RecordedEvent, ...]
    counts: LinkCounts
    ledgers: tuple[RunLedger, ...]
    warnings: tuple[str, ...]

    @property
    def duration_s(self) -> float:
        """Board time from first to last sample, summed over the runs, lost samples included."""
        return duration_s(self.runs)

    @property
    def nominal_rate(self) -> float:
        """Board seconds in a host second: 1, or the speed of a simulated board."""
        return _nominal_rate(self.metadata)


def read_recording(path: Path, window: Window | None = None) -> Recording:
    """Read a recording, or a window of one; one that was cut off is read as far as it goes, with a warning.

    Raises:
        InputError: no such file, or not a recording of impid-host.
    """
    reading = _Reading(path, window, keep=True)
    growing: dict[int, _Growing] = {}
    for segment in reading.pieces():
        growing.setdefault(segment.run, _Growing(segment.boot_id, segment.run)).add(segment)
    return reading.recording(tuple(grown.whole() for grown in growing.values()))


def survey(path: Path, window: Window | None = None) -> Recording:
    """What a recording of any length, or a window of one, holds, without its samples.

    Raises:
        InputError: no such file, or not a recording of impid-host.
    """
    reading = _Reading(path, window, keep=False)
    for _ in reading.pieces():
        pass
    return reading.recording(())


def sample_pieces(path: Path, window: Window | None = None) -> Iterator[Segment]:
    """The samples in pieces of a few seconds to minutes, in order; each piece belongs to one run.

    Raises:
        InputError: no such file, or not a recording of impid-host.
    """
    return _Reading(path, window, keep=False).pieces()


def read_metadata(path: Path) -> dict[str, dict[str, str]]:
    """The metadata of a recording, wherever in the file: name -> key -> value. Nothing else of it is read.

    Raises:
        InputError: no such file, or not a recording of impid-host.
    """
    with open_records(path, []) as file:
        return {item.name: item.values for item in file.metadata()}


def read_raw_can(path: Path, window: Window | None = None) -> Iterator[tuple[NDArray[np.void], int]]:
    """The CAN frames that came in, in pieces of shape (N,) of CAN_FRAME, and wall minus monotonic clock, ns.

    Raises:
        InputError: no such file, not a recording of impid-host, or one of a serial line.
    """
    reading = _Reading(path, window, keep=False)
    for data in reading.raw():
        if reading.carrier is not CAN:
            raise InputError(
                path,
                "was recorded over a serial line and holds no CAN frames",
                "export it as .parquet, .mat or a study folder",
            )
        yield unpack_frames(data), reading.wall_minus_monotonic_ns or 0


@dataclass(slots=True)
class _Growing:
    """Samples of a run, column by column: joined, they exist only once."""

    boot_id: int
    run: int
    columns: dict[str, list[NDArray[Any]]] = field(default_factory=dict)

    def add(self, segment: Segment) -> None:
        self.columns.setdefault("index", []).append(segment.index)
        for column in fields(DeviceSamples):
            values = getattr(segment.samples, column.name)
            if values is not None:
                self.columns.setdefault(column.name, []).append(values)

    def whole(self) -> Segment:
        joined = {name: np.concatenate(self.columns.pop(name)) for name in list(self.columns)}
        return Segment(self.boot_id, self.run, joined.pop("index"), DeviceSamples(**joined))


@dataclass(slots=True)
class _Reading:
    """One pass over a file, and what it adds up to."""

    path: Path
    window: Window | None
    keep: bool  # statuses
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    carrier: Carrier = SERIAL
    wall_minus_monotonic_ns: int | None = None
    warnings: list[str] = field(default_factory=list)
    events: list[RecordedEvent] = field(default_factory=list)
    runs: dict[int, Run] = field(default_factory=dict)
    _begun: bool = False
    _resume: Position | None = None  # where the stream stood at the first chunk that was read
    _since: tuple[int, int] | None = None  # run and stamp of the first sample of a window,
    _until: tuple[int, int] | None = None  # and of the last
    _waiting: bytearray = field(default_factory=bytearray)
    _exchanges: dict[int, "array[int]"] = field(default_factory=dict)
    _told: list[NDArray[Any]] = field(default_factory=list)
    _statuses: list[Sequence[BoardStatus]] = field(default_factory=list)
    _responses: list[Response] = field(default_factory=list)
    _changes: list[Loss | NewRun] = field(default_factory=list)
    _decoder: Decoder | None = None

    def raw(self) -> Iterator[bytes]:
        """The bytes that came in, a megabyte at a time."""
        with open_records(self.path, self.warnings) as file:
            for item in file.items(self.window):
                if isinstance(item, Metadata):
                    self.metadata[item.name] = item.values
                else:
                    try:
                        self._take(item)
                    except (ValueError, KeyError, TypeError, OverflowError):
                        self.warnings.append(
                            f"{self.path}: a message on {item.topic} makes no sense and is skipped"
                        )
                if len(self._waiting) >= _PIECE_BYTES:
                    yield self._piece()
        if self._waiting:
            yield self._piece()

    def pieces(self) -> Iterator[Segment]:
        """The samples up to the duration that was asked for, in order."""
        for data in self.raw():
            if self._decoder is None:
                self._decoder = self.carrier.decoder()
                if self._resume is not None:
                    self._decoder.resume(self._resume)
            decoded = self._decoder.feed(data)
            self._note(decoded)
            end = self._end()
            for segment in decoded.segments:
                inside = since(segment, self._since)
                kept = None if inside is None else Run.see(self.runs, inside, end)
                if kept is not None:
                    yield kept

    def recording(self, segments: tuple[Segment, ...]) -> Recording:
        """Everything, once the pass is over."""
        exchanges: dict[int, Sequence[ClockExchange]] = {
            boot_id: Exchanges(np.frombuffer(rows, np.int64).reshape(-1, 4))
            for boot_id, rows in self._exchanges.items()
        }
        runs = tuple(self.runs.values())
        if self.warnings:
            last = runs[-1].last_us - runs[-1].first_us if runs else 0
            self.warnings.append(
                f"{self.path}: {sum(run.stored for run in runs)} samples could be read, the last run "
                f"up to {last * 1e-6:.3f} s after its beginning"
            )
        # The board's count is of the whole run: it balances no window.
        told = np.concatenate([np.zeros(0, TOLD), *(self._told if self.window is None else ())])
        return Recording(
            path=self.path,
            carrier=self.carrier.name,
            metadata=self.metadata,
            segments=segments,
            runs=tuple(run for run in runs if run.stored),
            statuses=_joined(self._statuses),
            responses=tuple(self._responses),
            exchanges=exchanges,
            events=tuple(self.events),
            counts=(self._decoder or self.carrier.decoder()).counts,
            ledgers=balance(runs, self._changes, told, self._responses, self._ended_boots(exchanges)),
            warnings=tuple(self.warnings),
        )

    def _piece(self) -> bytes:
        whole = len(self._waiting) // self.carrier.piece_bytes * self.carrier.piece_bytes
        data = bytes(self._waiting[:whole])
        self._waiting.clear()
        return data

    def _take(self, message: Message) -> None:
        topic, data, at_s = message
        if topic in _CARRIERS:
            self.carrier = _CARRIERS[topic]
            wire = unpack(data, self.carrier.name)
            if not self._begun:  # where the file's beginning is damaged, or a window begins
                self._begun, self._resume = True, wire.position
            if self.window is not None and self._is_behind(self.window, at_s, wire.position):
                return
            if self.wall_minus_monotonic_ns is None and len(wire.rx_calls):
                self.wall_minus_monotonic_ns = int(wire.rx_calls["wall_minus_ns"][0])
            self._waiting += wire.rx.data
            for row in wire.exchanges:
                self._exchange(row[4], row[:4])
        elif topic == channels.EVENTS.name:
            body = json.loads(data)
            self.events.append(
                RecordedEvent(
                    body["event"], int(body["monotonic_ns"]), int(body["wall_ns"]), dict(body["detail"])
                )
            )
        elif topic in (channels.OLD_RX, channels.OLD_CAN_RX):
            self.carrier = SERIAL if topic == channels.OLD_RX else CAN
            body = json.loads(data)
            if self.wall_minus_monotonic_ns is None:
                self.wall_minus_monotonic_ns = int(body["wall_ns"]) - int(body["monotonic_ns"])
            self._waiting += base64.b64decode(body["data"], validate=True)
        elif topic == channels.OLD_CLOCK:
            body = json.loads(data)
            self._exchange(
                int(body["boot_id"]), [int(body[key]) for key in ("t1_ns", "t2_us", "t3_us", "t4_ns")]
            )

    def _is_behind(self, window: Window, at_s: float, position: Position | None) -> bool:
        """Take in where the stream stands at a chunk of the window; True for the one that ends it."""
        if at_s >= window.start_s and self._since is None:
            self._since = (-1, 0) if position is None else (position.run, position.t_us)
        if at_s <= window.stop_s:
            return False
        self._until = None if position is None else (position.run, position.t_us - 1)
        return True

    def _exchange(self, boot_id: int, row: Sequence[int]) -> None:
        self._exchanges.setdefault(boot_id, array("q")).extend(row)

    def _note(self, decoded: Decoded) -> None:
        self._told.append(told_by(decoded.statuses))
        if decoded.statuses:
            if not self.keep:
                self._statuses.clear()
            self._statuses.append(decoded.statuses if self.keep else decoded.statuses[-1:])
        self._responses += decoded.responses
        self._changes += decoded.events

    def _end(self) -> tuple[int, int] | None:
        """Run and last stamp (us) of the window or the duration that was asked for; None where something else
        ended it."""
        if self._until is not None:
            return self._until
        for event in self.events:
            if event.name == "enough":
                return int(event.detail["run"]), int(event.detail["last_us"])
        return None

    def _ended_boots(self, exchanges: dict[int, Sequence[ClockExchange]]) -> list[EndedBoot]:
        """What is known of the boots that a reset ended, from the notes of the recorder."""
        return [
            EndedBoot(
                boot_id=int(event.detail["before"]),
                produced=event.detail.get("produced"),
                exchanges=exchanges.get(int(event.detail["before"]), ()),
                next_exchanges=exchanges.get(int(event.detail["boot_id"]), ()),
                nominal_rate=_nominal_rate(self.metadata),
            )
            for event in self.events
            if event.name == "boot"
        ]


def _joined(parts: list[Sequence[BoardStatus]]) -> Sequence[BoardStatus]:
    rows = [part for part in parts if isinstance(part, Statuses)]
    if rows and len(rows) == len(parts):
        return Statuses.joined(rows)
    return tuple(status for part in parts for status in part)


_CARRIERS = {channels.WIRE.name: SERIAL, channels.CAN_WIRE.name: CAN}


def _nominal_rate(metadata: dict[str, dict[str, str]]) -> float:
    return float(metadata.get(channels.METADATA_HOST, {}).get("speed", "1"))
