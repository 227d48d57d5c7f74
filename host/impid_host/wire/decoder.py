"""Serial bytes to samples, statuses and answers. All samples of a piece are unpacked by numpy at once."""

from dataclasses import astuple, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impid_host.samples import DeviceSamples
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
    STATUS,
    WORD_BYTES,
    MessageLayout,
    Words,
)
from impid_host.wire.records import BoardStatus, Decoded, Pong, Response, Segment
from impid_host.wire.tracker import Groups, Position, SampleCounts, Tracker

_SEQ_MODULUS = 1 << 16
_SAMPLES = (KIND["SAMPLES"], KIND["SAMPLES_WIDE"])
_LOW32 = 1 << 32


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
        frames = self._deframer.feed(data)
        if not len(frames):
            return Decoded()
        self._count_lost_frames(frames)
        kinds = frames.headers["kind"]
        is_batch = np.isin(kinds, _SAMPLES)
        batch = np.flatnonzero(is_batch)
        segments, events = self._samples(frames.headers[batch], [frames.records[i] for i in batch.tolist()])
        statuses: list[BoardStatus] = []
        responses: list[Response] = []
        pongs: list[Pong] = []
        for i in np.flatnonzero(~is_batch).tolist():
            kind, header, words = (
                int(kinds[i]),
                frames.headers[i],
                np.frombuffer(frames.records[i], dtype="<u8"),
            )
            if kind == KIND["STATUS"]:
                each = len(words) // max(int(header["count"]), 1)
                statuses += [_status(header, row) for row in words.reshape(-1, max(each, 1))]
            elif kind == KIND["RESPONSE"]:
                responses += [_response(header, word) for word in words]
            elif kind == KIND["PONG"]:
                pongs += [_pong(header, word) for word in words]
        return Decoded(tuple(segments), tuple(statuses), tuple(responses), tuple(pongs), tuple(events))

    def _count_lost_frames(self, frames: Frames) -> None:
        for boot_id, seq in zip(
            frames.headers["boot_id"].tolist(), frames.headers["frame_seq"].tolist(), strict=True
        ):
            if self._last_frame is not None and self._last_frame[0] == boot_id:
                missing = (seq - self._last_frame[1] - 1) % _SEQ_MODULUS
                if missing >= _SEQ_MODULUS // 2:  # an echo of an older frame: nothing is missing
                    continue
                self._lost_frames += missing
            self._last_frame = (boot_id, seq)

    def _samples(self, headers: NDArray[Any], records: list[bytes]) -> tuple[list[Segment], list[Any]]:
        words = _words(headers["kind"], records)
        accel, encoder = ACCEL.unpack(words[:, 0]), ENCODER.unpack(words[:, 1])
        count = headers["count"].astype(np.int64)
        ends = np.cumsum(count)
        within = np.arange(len(words)) - np.repeat(ends - count, count)
        low32 = np.repeat(headers["first_index"].astype(np.uint64), count) + within.astype(np.uint64)
        wrong = _contradicts(low32, accel, encoder)
        if wrong.any():
            bad = np.zeros(len(headers), dtype=np.bool_)
            bad[np.searchsorted(ends, np.flatnonzero(wrong), side="right")] = True
            self._inconsistent += int(bad.sum())
            keep = np.flatnonzero(~bad)
            return self._samples(headers[keep], [records[i] for i in keep.tolist()])
        groups = Groups(headers["boot_id"], headers["first_index"], headers["t0_us"], headers["count"])
        spans, events = self._tracker.place(groups)
        t_us = np.repeat(headers["t0_us"].astype(np.uint64), count) + within.astype(np.uint64) * np.uint64(
            SAMPLE_PERIOD_US
        )
        starts = np.append(ends - count, len(words))
        segments = []
        for span in spans:
            rows = slice(int(starts[span.start]), int(starts[span.stop]))
            index = np.uint64(span.first_index) + np.arange(rows.stop - rows.start, dtype=np.uint64)
            samples = device_samples(t_us[rows], low32[rows], words[rows])
            segments.append(Segment(span.boot_id, span.run, index, samples))
        return segments, events


def _contradicts(low32: Words, accel: dict[str, Words], encoder: dict[str, Words]) -> NDArray[np.bool_]:
    """Samples whose own index bits are not those that the header gives them, shape (N,)."""
    wrong: NDArray[np.bool_] = (accel["index_low16"] != (low32 & np.uint64(0xFFFF))) | (
        encoder["index_low8"] != (low32 & np.uint64(0xFF))
    )
    return wrong


def _words(kinds: NDArray[np.uint8], records: list[bytes]) -> Words:
    """ACCEL, ENCODER and, where one of the frames has it (else without a column), ACCEL_FINE: (N, 2 or 3)."""
    if not (kinds == KIND["SAMPLES_WIDE"]).any():
        return np.frombuffer(b"".join(records), dtype="<u8").reshape(-1, 2)
    rows = []
    for kind, record in zip(kinds.tolist(), records, strict=True):
        columns = RECORD_BYTES[kind][0] // WORD_BYTES
        part = np.frombuffer(record, dtype="<u8").reshape(-1, columns)
        rows.append(np.pad(part, ((0, 0), (0, 3 - columns))))
    return np.concatenate(rows)


def device_samples(t_us: Words, index: Words, words: Words) -> DeviceSamples:
    """Samples of one run: times and indices (N,), and ACCEL, ENCODER and perhaps ACCEL_FINE (N, 2 or 3)."""
    accel, encoder = ACCEL.unpack(words[:, 0]), ENCODER.unpack(words[:, 1])
    enc1, enc2 = (_counter(accel[f"enc{n}_high4"], encoder[f"enc{n}_low28"]) for n in (1, 2))
    flags = (accel["flags"] & np.uint64(0xFF ^ FLAG_FINE)).astype(np.uint8)
    seq = index.astype(np.uint32)
    if not len(words) or not int(accel["flags"][0]) & FLAG_FINE:
        ax, ay = accel["ax"].astype(np.uint16), accel["ay"].astype(np.uint16)
        return DeviceSamples(t_us, seq, ax, ay, enc1, enc2, flags)
    fine = ACCEL_FINE.unpack(words[:, 2])

    def code(high16: Words, axis: str) -> NDArray[np.uint32]:
        return ((high16 << np.uint64(8)) | fine[f"a{axis}_low8"]).astype(np.uint32)

    x, y, z = code(accel["ax"], "x"), code(accel["ay"], "y"), code(fine["az_high16"], "z")
    return DeviceSamples(t_us, seq, x, y, enc1, enc2, flags, z)


def _counter(high4: Words, low28: Words) -> NDArray[np.int32]:
    return ((high4 << np.uint64(28)) | low28).astype(np.uint32).view(np.int32)


def scalars(layout: MessageLayout, word: int) -> dict[str, int]:
    """Signals of one message as Python integers."""
    return {name: (word >> shift) & mask for name, (shift, mask) in layout.fields.items()}


def _status(header: Any, words: Words) -> BoardStatus:
    signals: dict[str, int] = {}
    for layout, word in zip(STATUS, words.tolist(), strict=False):  # an older board sends fewer
        signals |= scalars(layout, word)
    return BoardStatus(int(header["boot_id"]), int(header["t0_us"]), int(header["first_index"]), **signals)


def _response(header: Any, word: np.uint64) -> Response:
    signals = scalars(RESPONSE, int(word))
    return Response(int(header["boot_id"]), int(header["t0_us"]), int(header["first_index"]), **signals)


def _pong(header: Any, word: np.uint64) -> Pong:
    signals = scalars(PONG, int(word))
    t2_us = extend_low32(signals["t2_us"], int(header["t0_us"]))
    return Pong(int(header["boot_id"]), signals["request_id"], t2_us, t2_us + signals["hold_us"])


def extend_low32(low32: int, later: int) -> int:
    """The last instant up to `later` (64 bit) whose low 32 bits are `low32`."""
    return later - (later - low32) % _LOW32
