"""The serial framing once more, from public libraries and the DBC alone: cobs, zlib, cantools."""

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cantools
import cantools.database.can
from cobs import cobs

DBC: cantools.database.can.Database = cantools.database.load_file(  # type: ignore[assignment]
    Path(__file__).resolve().parents[2] / "protocol" / "impid.dbc"
)
RECORDS = {
    1: ["ACCEL", "ENCODER"],
    2: [
        f"STATUS_{name}"
        for name in ("SAMPLES", "LINK", "TIMING", "SENSORS", "COMMANDS", "HEALTH", "BUS", "LOSSES")
    ],
    3: ["RESPONSE"],
    4: ["PONG"],
    16: ["COMMAND"],
}

Parse = Callable[[bytes], dict[str, Any]]  # the C parser as a function


@dataclass(frozen=True)
class Frame:
    """A frame's header fields by name and its records, one dict of all their signals each."""

    header: dict[str, int]
    records: list[dict[str, int]]


def pack(message: str, **signals: int) -> bytes:
    return bytes(DBC.encode_message(message, signals, scaling=False))


def unpack(message: str, data: bytes) -> dict[str, Any]:
    return dict(DBC.decode_message(message, data, decode_choices=False))  # type: ignore[arg-type]


def encode(payload: bytes, **header: int) -> bytes:
    """One frame on the wire, delimiter included."""
    fields = {"version": 1, "boot_id": 0, "frame_seq": 0, "flags": 0, "first_index": 0, "t0_us": 0} | header
    raw = pack("BATCH", **fields) + payload
    return bytes(cobs.encode(raw + zlib.crc32(raw).to_bytes(4, "little"))) + b"\0"


def decode(chunk: bytes) -> Frame:
    """The frame in `chunk` (no delimiter); asserts that everything about it holds."""
    raw = cobs.decode(chunk)
    assert zlib.crc32(raw[:-4]) == int.from_bytes(raw[-4:], "little")
    header = unpack("BATCH", raw[:20])
    names = RECORDS[header["kind"]]
    body = raw[20:-4]
    size = 8 * len(names)
    assert len(body) == header["count"] * size
    records = []
    for start in range(0, len(body), size):
        record: dict[str, int] = {}
        for n, name in enumerate(names):
            record |= unpack(name, body[start + 8 * n : start + 8 * n + 8])
        records.append(record)
    return Frame(header, records)


def encoder_count(high4: int, low28: int) -> int:
    """The signed 32-bit counter out of its two fields."""
    value = high4 << 28 | low28
    return value - (1 << 32) if value >= 1 << 31 else value
