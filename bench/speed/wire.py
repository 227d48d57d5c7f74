"""Decoding: ours, a loop over `struct`, fifteen lines of numpy, the memory itself; python-can's BLF reader."""

import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path

import can
import day
import numpy as np
from cobs import cobs
from decoder_speed import SAMPLES, stream
from impid_host.wire.can_frames import CAN_FRAME, CanBytesDecoder
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.messages import ACCEL, ENCODER, HEADER, OPCODE

from hil_sim.board.native import BoardConfig, NativeBoard

CAN_TICKS = 200_000
SLACK = 100  # samples at the start and the end, where the decoder waits for the clock
_CRC = 4
_PIECE = 100


def serial(piece: int) -> Iterator[int]:
    """Our decoder, fed pieces of so many bytes."""
    raw, decoder = stream(), SerialDecoder()
    yield SAMPLES
    for at in range(0, len(raw), piece):
        decoder.feed(raw[at : at + piece])
    assert decoder.counts.stored == SAMPLES


def serial_loop() -> Iterator[int]:
    """As anybody writes it first: frame by frame, record by record; no check, no count of what is lost."""
    raw, rows = stream(), []
    yield SAMPLES
    for frame in raw.split(b"\0")[:-1]:
        body = cobs.decode(frame)[HEADER.itemsize : -_CRC]
        for accel, encoder in struct.iter_unpack("<QQ", body):
            high, low = _counts(accel, encoder)
            rows.append((accel & 0xFFFF, accel >> 16 & 0xFFFF, high, low))
    assert len(rows) == SAMPLES


def _counts(accel: int, encoder: int) -> tuple[int, int]:
    return (
        (accel >> _AT["enc1_high4"] & 0xF) << 28 | encoder & 0xFFFFFFF,
        (accel >> _AT["enc2_high4"] & 0xF) << 28 | encoder >> _AT["enc2_low28"] & 0xFFFFFFF,
    )


_AT = {name: shift for layout in (ACCEL, ENCODER) for name, (shift, _) in layout.fields.items()}


def serial_numpy() -> Iterator[int]:
    """All frames taken apart by COBS in C, then numpy once; no check, no count of what is lost."""
    raw = stream()
    yield SAMPLES
    bodies = [cobs.decode(frame)[HEADER.itemsize : -_CRC] for frame in raw.split(b"\0")[:-1]]
    words = np.frombuffer(b"".join(bodies), dtype="<u8").reshape(-1, 2)
    columns = ACCEL.unpack(words[:, 0]) | ENCODER.unpack(words[:, 1])
    counts = [columns[f"enc{k}_high4"] << np.uint64(28) | columns[f"enc{k}_low28"] for k in (1, 2)]
    assert len(counts[0]) == SAMPLES


def memory() -> Iterator[int]:
    """The bytes copied once."""
    raw = stream()
    yield SAMPLES
    bytes(bytearray(raw))


def can_ours() -> Iterator[int]:
    """Our decoder on the frames that a board sends in 200 s."""
    raw, samples = frames()
    yield samples
    decoder = CanBytesDecoder()
    decoder.feed(raw)
    assert decoder.counts.stored == samples


def can_loop() -> Iterator[int]:
    """Frame by frame by `struct`; no check, no count of what is lost."""
    raw, samples = frames()
    yield samples
    accels, rows = 0, []
    for _, identifier, _, data in struct.iter_unpack("<QIB3xQ", raw):
        if identifier == ACCEL.frame_id:
            accels = data
        elif identifier == ENCODER.frame_id:
            rows.append((accels & 0xFFFF, accels >> 16 & 0xFFFF, *_counts(accels, data)))
    assert abs(len(rows) - samples) < SLACK


def can_blf() -> Iterator[int]:
    """The same frames from the file of python-can's own logger, message by message."""
    raw, samples = frames()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.blf"
        write_blf(raw, path)
        yield samples
        with can.LogReader(path) as reader:
            read = sum(message.arbitration_id == ACCEL.frame_id for message in reader)
    assert abs(read - samples) < SLACK


def write_blf(raw: bytes, path: Path) -> None:
    """Frames as python-can logs them."""
    with can.BLFWriter(path) as writer:
        for number, frame in enumerate(np.frombuffer(raw, dtype=CAN_FRAME)):
            data = frame["data"].tobytes()[: int(frame["dlc"])]
            identifier = int(frame["identifier"])
            writer(can.Message(number / 2000, identifier, is_extended_id=False, data=data))


def frames() -> tuple[bytes, int]:
    """What a board sends over CAN, as the recording keeps it, and how many samples that is."""
    board = NativeBoard(BoardConfig(boot_id=9))
    adc, pieces = np.full((_PIECE, 8, 2), 2048, dtype=np.uint16), []
    day.command(board, "can", 1, OPCODE["START"])
    for tick in range(0, CAN_TICKS, _PIECE):
        counts = np.arange(tick, tick + _PIECE, dtype=np.int32)
        board.run(adc, np.column_stack([counts, -counts]))
        pieces.append(day.can_frames(board))
    raw = b"".join(pieces)
    decoder = CanBytesDecoder()
    decoder.feed(raw)
    return raw, decoder.counts.stored
