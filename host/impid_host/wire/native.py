"""The hot loops of the serial decoder in C, where the package was built with a compiler and cffi is there."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from impid_host.wire.frame import CRC_BYTES, LARGEST_FRAME_BYTES
from impid_host.wire.messages import (
    ACCEL,
    ENCODER,
    FLAG_FINE,
    HEADER,
    HEADER_OFFSET,
    PROTOCOL_VERSION,
    RECORD_BYTES,
    MessageLayout,
    Words,
)

try:
    from impid_host.wire._native import ffi, lib
except ImportError:
    ffi = lib = None

available = lib is not None
_SMALLEST_FRAME_BYTES = HEADER.itemsize + CRC_BYTES
_ACCEL = ("ax", "ay", "index_low16", "flags", "enc1_high4", "enc2_high4")
_ENCODER = ("enc1_low28", "enc2_low28", "index_low8")


def deframe(
    data: bytes, *, joined: bool, overlong: bool
) -> tuple[NDArray[Any], NDArray[np.uint8], NDArray[np.int64], Any]:
    """Headers (N,), records of all frames, their ends (N,), and an `impid_deframed`."""
    headers = np.empty(len(data), np.uint8)
    records = np.empty(len(data), np.uint8)
    ends = np.empty(len(data) // _SMALLEST_FRAME_BYTES + 1, np.int64)
    found = ffi.new("impid_deframed *", {"joined": joined, "overlong": overlong})
    lib.impid_deframe(
        _FRAMES,
        ffi.from_buffer(data),
        len(data),
        _SCRATCH,
        ffi.from_buffer("uint8_t[]", headers),
        ffi.from_buffer("uint8_t[]", records),
        ffi.from_buffer("int64_t[]", ends),
        found,
    )
    told = headers[: found.frames * HEADER.itemsize].view(HEADER)
    return told, records[: found.record_bytes], ends[: found.frames], found


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
        _SAMPLES,
        ffi.from_buffer("uint64_t[]", words),
        count,
        ffi.from_buffer("uint32_t[]", index),
        0xFF ^ FLAG_FINE,
        *pointers,
        ffi.from_buffer("uint8_t[]", wrong),
    )
    return columns, wrong if contradicting else None


_POINTER = {"u2": "uint16_t[]", "i4": "int32_t[]", "u1": "uint8_t[]"}


def _frame_layout() -> Any:
    layout = ffi.new("impid_frame_layout *")
    layout.header_bytes, layout.version = HEADER.itemsize, PROTOCOL_VERSION
    layout.largest = LARGEST_FRAME_BYTES
    layout.kind_at, layout.version_at, layout.count_at = (
        HEADER_OFFSET[name] for name in ("kind", "version", "count")
    )
    for kind, sizes in RECORD_BYTES.items():
        for n, size in enumerate(sizes):
            layout.record_bytes[kind][n] = size
    return layout


def _signals(layout: MessageLayout, names: tuple[str, ...]) -> list[dict[str, int]]:
    return [dict(zip(("shift", "mask"), layout.fields[name], strict=True)) for name in names]


if available:
    _FRAMES = _frame_layout()
    _SAMPLES = ffi.new(
        "impid_sample_layout *", {"accel": _signals(ACCEL, _ACCEL), "encoder": _signals(ENCODER, _ENCODER)}
    )
    _SCRATCH = ffi.new("uint8_t[]", LARGEST_FRAME_BYTES)
