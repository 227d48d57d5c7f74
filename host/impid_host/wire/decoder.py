"""Serial bytes to samples, statuses and answers. All samples of a piece are unpacked by numpy at once."""

from collections.abc import Iterable
from dataclasses import astuple, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impid_host.samples import DeviceSamples
from impid_host.wire import native
from impid_host.wire.deframer import Deframer, FrameCounts, Frames
from impid_host.wire.messages import (
    ACCEL,
    ACCEL_FINE,
    ENCODER,
    FLAG_FINE,
    KIND,
    PONG,
    RECORD_BYTES,
    RESPONSE,
    SAMPLE_PERIOD_US,
    WORD_BYTES,
    Words,
)
from impid_host.wire.records import Decoded, Pong, Response, Segment
from impid_host.wire.statuses import Statuses, scalars
from impid_host.wire.tracker import Groups, Position, SampleCounts, Tracker

_SEQ_MODULUS = 1 << 16
_SAMPLES = (KIND["SAMPLES"], KIND["SAMPLES_WIDE"])
_LOW32 = 1 << 32
_NARROW = 2  # words of a sample


@dataclass(frozen=True, slots=True)
class LinkCounts:
    """What the stream delivered so far, and what it cost.

    Attributes:
        good_frames, bad_frames: frames accepted; frames that were damaged.
        bytes_discarded: bytes that belonged to no good frame.
        lost_frames: frames missing in the board's own numbering.
        inconsistent: frames whose samples contradict their header; none of their samples is used.
        stored, lost: samples accepted; samples missing within runs.
        stale_groups: frames dropped because their samples were there already.
    """

    good_frames: int
    bad_frames: int
    bytes_discarded: int
    lost_frames: int
    inconsistent: int
    stored: int
    lost: int
    stale_groups: int


@dataclass(slots=True)
class SerialDecoder:
    """Decoder of one serial stream; feed it pieces of any size, in order."""

    _deframer: Deframer = field(default_factory=Deframer)
    _tracker: Tracker = field(default_factory=Tracker)
    _lost_frames: int = 0
    _inconsistent: int = 0
    _last_frame: tuple[int, int] | None = None  # boot_id, frame_seq

    @property
    def counts(self) -> LinkCounts:
        """Totals since the decoder was made."""
        frames: FrameCounts = self._deframer.counts
        samples: SampleCounts = self._tracker.counts
        return LinkCounts(
            frames.good_frames,
            frames.bad_frames,
            frames.bytes_discarded,
            self._lost_frames,
            self._inconsistent,
            *astuple(samples),
        )

    def resume(self, position: Position) -> None:
        """Begin in the middle of a stream, of which this sample comes next."""
        self._tracker.resume(position)

    def feed(self, data: bytes) -> Decoded:
        """What `data` completes."""
        followed = self._follow(data)
        if followed is not None:
            return followed
        frames = self._deframer.feed(data)
        if not len(frames):
            return Decoded()
        self._count_lost_frames(frames)
        kinds = frames.headers["kind"]
        is_batch = np.isin(kinds, _SAMPLES)
        words = _words(frames, is_batch)
        segments, events = self._samples(frames.headers[is_batch], words)
        others = np.flatnonzero(~is_batch)
        return _decoded(segments, events, frames, others.tolist())

    def _follow(self, data: bytes) -> Decoded | None:
        """In one pass, where all goes on from the last frame; None: not so, nothing was taken."""
        at, last = self._tracker.expected, self._last_frame
        if at is None or last is None or last[0] != at.boot_id:
            return None
        seq = (last[1] + 1) % _SEQ_MODULUS
        found = self._deframer.follow(data, at.boot_id, at.index, at.t_us, seq)
        if found is None:
            return None
        count = len(found.numbers)
        self._last_frame = (last[0], (found.next_seq - 1) % _SEQ_MODULUS)
        self._tracker.go_on(count, found.next_t_us)
        segments = []
        if count:
            segments.append(Segment(at.boot_id, at.run, found.numbers, DeviceSamples(**found.samples)))
        if found.others is None:
            return Decoded(tuple(segments))
        frames = Frames(*found.others)
        return _decoded(segments, [], frames, range(len(frames)))

    def _count_lost_frames(self, frames: Frames) -> None:
        boots, seqs = frames.headers["boot_id"], frames.headers["frame_seq"]
        if self._last_frame is not None:
            boots = np.append(np.uint16(self._last_frame[0]), boots)
            seqs = np.append(np.uint16(self._last_frame[1]), seqs)
        missing = np.diff(seqs) - np.uint16(1)
        if (boots == boots[0]).all() and (missing < _SEQ_MODULUS // 2).all():
            self._lost_frames += int(missing.sum(dtype=np.int64))
            self._last_frame = (int(boots[-1]), int(seqs[-1]))
            return
        for boot_id, seq in zip(boots.tolist(), seqs.tolist(), strict=True):
            self._count_lost_before(boot_id, seq)

    def _count_lost_before(self, boot_id: int, seq: int) -> None:
        if self._last_frame is not None and self._last_frame[0] == boot_id:
            missing = (seq - self._last_frame[1] - 1) % _SEQ_MODULUS
            if missing >= _SEQ_MODULUS // 2:  # an echo of an older frame, or itself: nothing is missing
                return
            self._lost_frames += missing
        self._last_frame = (boot_id, seq)

    def _samples(self, headers: NDArray[Any], words: Words) -> tuple[list[Segment], list[Any]]:
        count = headers["count"].astype(np.int64)
        ends = np.cumsum(count)
        within = np.arange(len(words)) - np.repeat(ends - count, count)
        low32 = np.repeat(headers["first_index"], count) + within.astype(np.uint32)
        columns, wrong = self._unpack(words, low32)
        if wrong is not None:
            bad = np.zeros(len(headers), dtype=np.bool_)
            bad[np.searchsorted(ends, np.flatnonzero(wrong), side="right")] = True
            self._inconsistent += int(bad.sum())
            return self._samples(headers[~bad], words[~np.repeat(bad, count)])
        groups = Groups(headers["boot_id"], headers["first_index"], headers["t0_us"], headers["count"])
        spans, events = self._tracker.place(groups)
        t_us = np.repeat(headers["t0_us"], count) + (within * SAMPLE_PERIOD_US).astype(np.uint64)
        starts = np.append(ends - count, len(words))
        segments = []
        for span in spans:
            rows = slice(int(starts[span.start]), int(starts[span.stop]))
            index = np.uint64(span.first_index) + np.arange(rows.stop - rows.start, dtype=np.uint64)
            # Of wide sensors span by span: a narrow one may follow on the same line.
            narrow = columns and {name: column[rows] for name, column in columns.items()}
            samples = DeviceSamples(
                t_us=t_us[rows], seq=low32[rows], **(narrow or sample_columns(words[rows]))
            )
            segments.append(Segment(span.boot_id, span.run, index, samples))
        return segments, events

    def _unpack(
        self, words: Words, low32: NDArray[np.uint32]
    ) -> tuple[dict[str, NDArray[Any]], NDArray[np.bool_] | None]:
        """The columns of `DeviceSamples` but time and number (empty where a sensor is wide), and which
        samples contradict their header (None: none)."""
        if self._deframer.native and words.shape[1] == _NARROW:
            return native.unpack(words, low32)
        wrong = _contradicts(low32, words)
        return sample_columns(words) if words.shape[1] == _NARROW else {}, wrong if wrong.any() else None


def _decoded(segments: list[Segment], events: list[Any], frames: Frames, others: Iterable[int]) -> Decoded:
    """With what the other frames say."""
    statuses: list[tuple[int, Words]] = []
    responses: list[Response] = []
    pongs: list[Pong] = []
    for i in others:
        header, record = frames.headers[i], frames.of(i).view("<u8")
        kind = int(header["kind"])
        if kind == KIND["STATUS"]:
            each = max(len(record) // max(int(header["count"]), 1), 1)
            statuses += [(i, row) for row in record.reshape(-1, each)]
        elif kind == KIND["RESPONSE"]:
            responses += [_response(header, word) for word in record]
        elif kind == KIND["PONG"]:
            pongs += [_pong(header, word) for word in record.tolist()]
    said = Statuses.of(frames.headers, statuses)
    return Decoded(tuple(segments), said, tuple(responses), tuple(pongs), tuple(events))


def _contradicts(low32: NDArray[np.uint32], words: Words) -> NDArray[np.bool_]:
    """Samples whose own index bits are not those that the header gives them, shape (N,)."""
    low16, low8 = ACCEL.signal("index_low16", words[:, 0]), ENCODER.signal("index_low8", words[:, 1])
    wrong: NDArray[np.bool_] = (low16 != low32.astype(low16.dtype)) | (low8 != low32.astype(low8.dtype))
    return wrong


def _words(frames: Frames, is_batch: NDArray[np.bool_]) -> Words:
    """ACCEL, ENCODER and, where one of the frames has it (else without a column), ACCEL_FINE: (N, 2 or 3)."""
    kinds = frames.headers["kind"]
    if not (kinds == KIND["SAMPLES_WIDE"]).any():
        words = frames.records.view("<u8")
        if not is_batch.all():
            words = words[np.repeat(is_batch, np.diff(frames.ends, prepend=0) // WORD_BYTES)]
        return words.reshape(-1, _NARROW)
    rows = []
    for i in np.flatnonzero(is_batch).tolist():
        columns = RECORD_BYTES[int(kinds[i])][0] // WORD_BYTES
        part = frames.of(i).view("<u8").reshape(-1, columns)
        rows.append(np.pad(part, ((0, 0), (0, 3 - columns))))
    return np.concatenate(rows)


def device_samples(t_us: Words, index: Words, words: Words) -> DeviceSamples:
    """Samples of one run: times and indices (N,), and ACCEL, ENCODER and perhaps ACCEL_FINE (N, 2 or 3)."""
    return DeviceSamples(t_us=t_us, seq=index.astype(np.uint32), **sample_columns(words))


def sample_columns(words: Words) -> dict[str, NDArray[Any]]:
    """What the words say of each sample, by the names of `DeviceSamples`, each (N,)."""
    accel = words[:, 0]
    said = ACCEL.signal("flags", accel)
    columns: dict[str, NDArray[Any]] = {f"enc{n}": _counter(words, n) for n in (1, 2)}
    columns["flags"] = said.astype(np.uint8) & np.uint8(0xFF ^ FLAG_FINE)
    if words.shape[1] == _NARROW or not len(words) or not int(said[0]) & FLAG_FINE:
        return columns | {name: ACCEL.signal(name, accel).astype(np.uint16) for name in ("ax", "ay")}
    fine = words[:, 2]
    high = {axis: ACCEL.signal(f"a{axis}", accel) for axis in "xy"}
    high["z"] = ACCEL_FINE.signal("az_high16", fine)
    for axis, high16 in high.items():
        low8 = ACCEL_FINE.signal(f"a{axis}_low8", fine)
        columns[f"a{axis}"] = (high16.astype(np.uint32) << np.uint32(8)) | low8
    return columns


def _counter(words: Words, number: int) -> NDArray[np.int32]:
    high4 = ACCEL.signal(f"enc{number}_high4", words[:, 0]).astype(np.uint32)
    low28 = ENCODER.signal(f"enc{number}_low28", words[:, 1]).astype(np.uint32)
    return ((high4 << np.uint32(28)) | low28).view(np.int32)


def _response(header: Any, word: np.uint64) -> Response:
    signals = scalars(RESPONSE, int(word))
    return Response(int(header["boot_id"]), int(header["t0_us"]), int(header["first_index"]), **signals)


def _pong(header: Any, word: int) -> Pong:
    signals = scalars(PONG, word)
    t2_us = extend_low32(signals["t2_us"], int(header["t0_us"]))
    return Pong(int(header["boot_id"]), signals["request_id"], t2_us, t2_us + signals["hold_us"])


def extend_low32(low32: int, later: int) -> int:
    """The last instant up to `later` (64 bit) whose low 32 bits are `low32`."""
    return later - (later - low32) % _LOW32
