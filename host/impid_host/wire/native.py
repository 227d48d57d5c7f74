"""The hot loops of the serial decoder in C, where the package was built with a compiler and cffi is there."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from impid_host.wire.frame import CRC_BYTES, LARGEST_FRAME_BYTES
from impid_host.wire.messages import (
    ACCEL,
    ENCODER,
    FLAG_FINE,
    HEADER,
    HEADER_OFFSET,
    KIND,
    PROTOCOL_VERSION,
    RECORD_BYTES,
    SAMPLE_PERIOD_US,
    MessageLayout,
    Words,
)

try:
    from impid_host.wire._native import ffi, lib
except ImportError:
    ffi = lib = None

__all__ = [
    "FLAGS_KEPT",
    "Followed",
    "Splitter",
    "available",
    "columns_of",
    "ffi",
    "lib",
    "new_block",
    "unpack",
]
available = lib is not None
_SMALLEST_FRAME_BYTES = HEADER.itemsize + CRC_BYTES
_ACCEL = ("ax", "ay", "index_low16", "flags", "enc1_high4", "enc2_high4")
_ENCODER = ("enc1_low28", "enc2_low28", "index_low8")


class Followed(NamedTuple):
    """A piece that goes on exactly where the stream stands.

    Attributes:
        samples: columns by the names of `DeviceSamples`, each (N,).
        numbers: their index, 64 bit, (N,).
        others: headers (K,), records and ends (K,) of the frames of other kinds, as `deframe` gives them;
            None where there are none.
        frames: how many good ones of any kind.
        pending_at: where what is no whole frame begins.
        next_t_us, next_seq: stamp of the sample expected next, number of the frame expected next.
    """

    samples: dict[str, NDArray[Any]]
    numbers: NDArray[np.uint64]
    others: tuple[NDArray[Any], NDArray[np.uint8], NDArray[np.int64]] | None
    frames: int
    pending_at: int
    next_t_us: int
    next_seq: int


class Splitter:
    """One stream's room in memory: C runs beside other threads, so no two streams share it."""

    def __init__(self) -> None:
        if not available:
            return
        self._scratch = ffi.new("uint8_t[]", LARGEST_FRAME_BYTES)
        self._found, self._position = ffi.new("impid_deframed *"), ffi.new("impid_position *")
        self._size = -1
        self._room: tuple[tuple[NDArray[Any], ...], tuple[Any, ...]] = ((), ())

    def deframe(
        self, data: bytes, *, joined: bool, overlong: bool
    ) -> tuple[NDArray[Any], NDArray[np.uint8], NDArray[np.int64], Any]:
        """Headers (N,), records of all frames, their ends (N,), and an `impid_deframed`."""
        (headers, records, ends), pointers = _room(len(data))
        found = ffi.new("impid_deframed *", {"joined": joined, "overlong": overlong})
        lib.impid_deframe(_FRAMES, ffi.from_buffer(data), len(data), self._scratch, *pointers, found)
        told = headers[: found.frames * HEADER.itemsize].view(HEADER)
        return told, records[: found.record_bytes], ends[: found.frames], found

    def follow(self, data: bytes, boot_id: int, index: int, t_us: int, seq: int) -> Followed | None:
        """Frames and samples at once, where nothing is damaged, lost, new or wide; else None.

        boot_id, index (64 bit) and t_us are those of the sample expected next, seq the number of the frame.
        """
        size = len(data)
        if size > self._size:
            self._room, self._size = _room(size), size
        rows, block = new_block(size // _SAMPLE_BYTES)
        found, position = self._found, self._position
        found.frames = found.record_bytes = found.followed = 0
        position.index, position.t_us, position.boot, position.seq = index, t_us, boot_id, seq
        made = lib.impid_follow(
            _FRAMES,
            SAMPLES,
            ffi.from_buffer(data),
            size,
            FLAGS_KEPT,
            position,
            ffi.from_buffer("uint8_t[]", block),
            rows,
            self._scratch,
            *self._room[1],
            found,
        )
        if made < 0:
            return None
        columns = columns_of(block, rows, made)
        others, frames = None, found.frames
        if frames:
            headers, records, ends = self._room[0]
            told = headers[: frames * HEADER.itemsize].copy().view(HEADER)
            others = told, records[: found.record_bytes].copy(), ends[:frames].copy()
        numbers = columns.pop("index")
        good = frames + found.followed
        return Followed(columns, numbers, others, good, found.pending_at, position.t_us, position.seq)


def _room(size: int) -> tuple[tuple[NDArray[Any], ...], tuple[Any, ...]]:
    """For the headers, records and ends of the frames in so many bytes; and where it is."""
    frames = size // _SMALLEST_FRAME_BYTES + 1
    room = np.empty(size, np.uint8), np.empty(size, np.uint8), np.empty(frames, np.int64)
    kinds = "uint8_t[]", "uint8_t[]", "int64_t[]"
    return room, tuple(ffi.from_buffer(kind, each) for kind, each in zip(kinds, room, strict=True))


def new_block(samples: int) -> tuple[int, NDArray[np.uint8]]:
    """Room for so many samples, as C lays them out: rows, block."""
    rows = (samples + 8) // 8 * 8
    return rows, np.empty(rows * _ROW_BYTES, np.uint8)


def columns_of(block: NDArray[np.uint8], rows: int, made: int) -> dict[str, NDArray[Any]]:
    """Its columns by the names of `DeviceSamples`, and index, each (made,)."""
    return {name: np.ndarray(made, kind, block, at * rows) for name, kind, at in _BLOCK}


def unpack(
    words: Words, index: NDArray[np.uint32]
) -> tuple[dict[str, NDArray[Any]], NDArray[np.bool_] | None]:
    """Columns ax, ay, enc1, enc2, flags of N samples of two words, shape (N, 2) in one piece, whose header
    counts `index`; and where their own index bits contradict it, None: nowhere."""
    count = len(words)
    kinds = {"ax": "u2", "ay": "u2", "enc1": "i4", "enc2": "i4", "flags": "u1"}
    columns = {name: np.empty(count, kind) for name, kind in kinds.items()}
    wrong = np.empty(count, np.bool_)
    pointers = [ffi.from_buffer(_POINTER[kind], columns[name]) for name, kind in kinds.items()]
    contradicting = lib.impid_unpack(
        SAMPLES,
        ffi.from_buffer("uint64_t[]", words),
        count,
        ffi.from_buffer("uint32_t[]", index),
        FLAGS_KEPT,
        *pointers,
        ffi.from_buffer("uint8_t[]", wrong),
    )
    return columns, wrong if contradicting else None


# As impid_follow lays them out: name, type, bytes of a row before it.
_COLUMNS = {
    "t_us": "u8",
    "index": "u8",
    "seq": "u4",
    "enc1": "i4",
    "enc2": "i4",
    "ax": "u2",
    "ay": "u2",
    "flags": "u1",
}
_BYTES = [np.dtype(kind).itemsize for kind in _COLUMNS.values()]
_BLOCK = [(name, np.dtype(kind), sum(_BYTES[:n])) for n, (name, kind) in enumerate(_COLUMNS.items())]
_ROW_BYTES = sum(_BYTES)
_SAMPLE_BYTES = RECORD_BYTES[KIND["SAMPLES"]][0]
FLAGS_KEPT = 0xFF ^ FLAG_FINE
_POINTER = {"u2": "uint16_t[]", "i4": "int32_t[]", "u1": "uint8_t[]"}


def _frame_layout() -> Any:
    layout = ffi.new("impid_frame_layout *")
    layout.header_bytes, layout.version = HEADER.itemsize, PROTOCOL_VERSION
    layout.largest = LARGEST_FRAME_BYTES
    layout.kind_at, layout.version_at, layout.count_at = (
        HEADER_OFFSET[name] for name in ("kind", "version", "count")
    )
    layout.boot_at, layout.seq_at, layout.index_at, layout.t0_at = (
        HEADER_OFFSET[name] for name in ("boot_id", "frame_seq", "first_index", "t0_us")
    )
    layout.samples, layout.samples_wide = KIND["SAMPLES"], KIND["SAMPLES_WIDE"]
    layout.period_us = SAMPLE_PERIOD_US
    for kind, sizes in RECORD_BYTES.items():
        for n, size in enumerate(sizes):
            layout.record_bytes[kind][n] = size
    return layout


def _signals(layout: MessageLayout, names: tuple[str, ...]) -> list[dict[str, int]]:
    return [dict(zip(("shift", "mask"), layout.fields[name], strict=True)) for name in names]


SAMPLES: Any = None  # of the C side; nothing without it
if available:
    _FRAMES = _frame_layout()
    SAMPLES = ffi.new(
        "impid_sample_layout *", {"accel": _signals(ACCEL, _ACCEL), "encoder": _signals(ENCODER, _ENCODER)}
    )
