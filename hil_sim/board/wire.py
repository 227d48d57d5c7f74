"""Serial frames, COBS(header | records | CRC-32) 00, as the simulator itself needs them.

The recorder has its own decoder; this one turns a simulated board's bytes into a study folder, hears when
the board accepts START, and sends commands to a board whose host is the simulator.
"""

import zlib
from dataclasses import dataclass

import numpy as np
from cobs import cobs
from numpy.typing import NDArray

from hil_sim.board import layout

FLAG_FINE = 0x20  # IMPID_FLAG_FINE
HEADER_BYTES = 20
CRC_BYTES = 4


@dataclass(frozen=True)
class Frame:
    """One frame whose CRC was right.

    Attributes:
        kind: see BATCH.kind in the message set.
        count: number of records.
        first_index: index of record 0 (samples), or of the next sample.
        t0_us: board time of record 0.
        records: their bytes.
    """

    kind: int
    count: int
    first_index: int
    t0_us: int
    records: bytes


@dataclass(frozen=True)
class Samples:
    """Decoded samples, n of them; columns as in device.csv. az is None of a sensor with two axes."""

    t_us: NDArray[np.int64]
    seq: NDArray[np.uint32]
    ax: NDArray[np.uint32]
    ay: NDArray[np.uint32]
    enc1: NDArray[np.int32]
    enc2: NDArray[np.int32]
    flags: NDArray[np.uint8]
    az: NDArray[np.uint32] | None = None


class FrameReader:
    """Bytes in, frames out; keeps the unfinished frame for the next bytes and counts damaged ones."""

    def __init__(self) -> None:
        self._rest = b""
        self.damaged = 0

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that these bytes complete."""
        *whole, self._rest = (self._rest + data).split(b"\x00")
        frames = []
        for stuffed in whole:
            frame = _frame(stuffed) if stuffed else None
            if frame is not None:
                frames.append(frame)
            elif stuffed:
                self.damaged += 1
        return frames


def _frame(stuffed: bytes) -> Frame | None:
    try:
        plain = cobs.decode(stuffed)
    except cobs.DecodeError:
        return None
    if len(plain) < HEADER_BYTES + CRC_BYTES:
        return None
    body, crc = plain[:-CRC_BYTES], plain[-CRC_BYTES:]
    if zlib.crc32(body) != int.from_bytes(crc, "little"):
        return None
    return Frame(
        kind=body[0],
        count=body[6],
        first_index=int.from_bytes(body[8:12], "little"),
        t0_us=int.from_bytes(body[12:20], "little"),
        records=body[HEADER_BYTES:],
    )


def command(request_id: int, opcode: str, *, item: int = 0, value: int = 0) -> bytes:
    """The bytes of one COMMAND, ready for the line."""
    opcode_number = layout.code("COMMAND", "opcode", opcode)
    payload = layout.database().encode_message(
        "COMMAND",
        {"request_id": request_id, "opcode": opcode_number, "item": item, "value": value},
        scaling=False,
    )
    header = layout.database().encode_message(
        "BATCH",
        {
            "kind": layout.code("BATCH", "kind", "COMMAND"),
            "version": 1,
            "boot_id": 0,
            "frame_seq": request_id,
            "count": 1,
            "flags": 0,
            "first_index": 0,
            "t0_us": 0,
        },
        scaling=False,
    )
    body = header + payload
    stuffed: bytes = cobs.encode(body + zlib.crc32(body).to_bytes(4, "little"))
    return stuffed + b"\x00"


def accepts_start(frame: Frame) -> bool:
    """The frame answers a START command with OK."""
    if frame.kind != layout.code("BATCH", "kind", "RESPONSE"):
        return False
    answer = layout.unpack("RESPONSE", np.frombuffer(frame.records, dtype=np.uint8).reshape(-1, 8))
    start = answer["opcode"] == layout.code("RESPONSE", "opcode", "START")
    return bool(np.any(start & (answer["result"] == layout.code("RESPONSE", "result", "OK"))))


def sample_kinds() -> tuple[int, int]:
    """The kinds of frames that hold samples."""
    return layout.code("BATCH", "kind", "SAMPLES"), layout.code("BATCH", "kind", "SAMPLES_WIDE")


def samples(frames: list[Frame]) -> Samples:
    """The samples in all SAMPLES or SAMPLES_WIDE frames, in the order in which they came; of one sensor."""
    batches = [frame for frame in frames if frame.kind in sample_kinds()]
    wide = any(frame.kind == layout.code("BATCH", "kind", "SAMPLES_WIDE") for frame in batches)
    counts = np.array([frame.count for frame in batches], dtype=np.int64)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    first = np.repeat(np.array([frame.first_index for frame in batches], dtype=np.int64), counts)
    start = np.repeat(np.array([frame.t0_us for frame in batches], dtype=np.int64), counts)
    joined = b"".join(frame.records for frame in batches)
    records = np.frombuffer(joined, dtype=np.uint8).reshape(-1, 24 if wide else 16)
    accel = layout.unpack("ACCEL", records[:, :8])
    encoder = layout.unpack("ENCODER", records[:, 8:16])
    shift = np.uint64(28)
    ax, ay, az = accel["ax"], accel["ay"], None
    if wide:
        fine = layout.unpack("ACCEL_FINE", records[:, 16:])
        eight = np.uint64(8)
        ax, ay = ax << eight | fine["ax_low8"], ay << eight | fine["ay_low8"]
        az = (fine["az_high16"] << eight | fine["az_low8"]).astype(np.uint32)
    return Samples(
        t_us=start + 1000 * within,
        seq=(first + within).astype(np.uint32),
        ax=ax.astype(np.uint32),
        ay=ay.astype(np.uint32),
        enc1=((accel["enc1_high4"] << shift) | encoder["enc1_low28"]).astype(np.uint32).view(np.int32),
        enc2=((accel["enc2_high4"] << shift) | encoder["enc2_low28"]).astype(np.uint32).view(np.int32),
        flags=accel["flags"].astype(np.uint8) & np.uint8(0xFF ^ FLAG_FINE),
        az=az,
    )
