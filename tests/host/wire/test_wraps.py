"""Both carriers across the wraps of sample index, clock, frame number and the index bits of CAN."""

import numpy as np
import pytest
from impid_host.wire.can_frames import pack_frame
from impid_host.wire.carrier import CAN, SERIAL
from impid_host.wire.messages import OPCODE
from impid_host.wire.records import Loss, join_segments

from hil_sim.board.native import BoardConfig, NativeBoard

PIECE = 50
TICKS = 700_000  # frame_seq wraps after 655 s of full batches, the index bits of CAN after 66 s
AHEAD = 300_000


@pytest.mark.parametrize("carrier", [SERIAL, CAN], ids=["serial", "can"])
def test_every_wrap_with_losses_on_both_sides(carrier) -> None:
    ticks = TICKS if carrier is SERIAL else TICKS // 5
    ahead = min(AHEAD, ticks // 2)
    start_us = 2**32 - ahead * 1000
    board = NativeBoard(
        BoardConfig(boot_id=9, first_index=2**32 - ahead, start_us=start_us, serial_bytes_per_ms=0)
    )
    decoder = carrier.decoder()
    adc = np.full((PIECE, 8, 2), 2048, dtype=np.uint16)
    command(board, carrier, 1, "START")
    parts, produced = [], None
    for number in range(ticks // PIECE + 2):
        counts = np.arange(number * PIECE, (number + 1) * PIECE, dtype=np.int32)
        if number == ticks // PIECE:
            command(board, carrier, 2, "STOP")
        board.run(adc, np.column_stack([counts, -counts]))
        data = take(board, carrier)
        if number % 97 == 50 and number < ticks // PIECE - 10:
            continue  # lost on the way
        parts.append(decoder.feed(data))
        produced = next((r.value for r in parts[-1].responses if r.opcode == OPCODE["STOP"]), produced)
    (segment,) = join_segments([s for part in parts for s in part.segments])
    lost = sum(e.lost for part in parts for e in part.events if isinstance(e, Loss))
    assert produced == len(segment) + lost
    assert lost > 1000
    tick = segment.samples.enc1.astype(np.int64)
    assert np.array_equal(segment.samples.t_us.astype(np.int64), start_us + tick * 1000)
    assert np.array_equal(np.diff(segment.index.astype(np.int64)), np.diff(tick))
    assert np.array_equal(
        segment.samples.seq, (2**32 - ahead + tick - tick[0]).astype(np.uint64) & np.uint64(2**32 - 1)
    )
    assert int(segment.index[-1]) > 2**32


def command(board: NativeBoard, carrier, request_id: int, opcode: str) -> None:
    data = carrier.encode_command(request_id, OPCODE[opcode], 0, 0)
    if carrier is SERIAL:
        board.serial_receive(b"\0" + data, board.now_us)
    else:
        board.can_receive(0x100, data[16:24], board.now_us)


def take(board: NativeBoard, carrier) -> bytes:
    if carrier is SERIAL:
        return board.serial_take()
    return b"".join(pack_frame(0, identifier, data) for identifier, data in board.can_take())


def test_halves_that_are_a_lap_apart_are_not_one_sample() -> None:
    """ACCEL of sample k, 256 samples lost with the plug out, ENCODER of k + 256: the index bits agree."""
    decoder = CAN.decoder()

    def frames(index: int, now_ns: int) -> tuple[bytes, bytes]:
        accel = (1 << 0) | (2 << 16) | ((index & 0xFFFF) << 32)
        encoder = (index & 0xFF) << 56
        first = pack_frame(now_ns, 0x110, accel.to_bytes(8, "little"))
        return first, pack_frame(now_ns, 0x111, encoder.to_bytes(8, "little"))

    t_us, boot = 5000, 1
    date = pack_frame(0, 0x118, (t_us | (10 << 48)).to_bytes(8, "little"))
    epoch = pack_frame(0, 0x119, (10 | (boot << 32) | (1 << 48)).to_bytes(8, "little"))
    stream = date + epoch + b"".join(frames(10, 1_000_000))
    stream += frames(11, 2_000_000)[0] + frames(11 + 256, 258_000_000)[1] + b"".join(frames(268, 259_000_000))
    (segment,) = join_segments(list(decoder.feed(stream).segments))
    assert segment.index.tolist() == [10, 268]
    assert segment.samples.t_us.tolist() == [5000, 5000 + 258_000]


def test_frames_of_other_devices_are_passed_over() -> None:
    """Extended, remote and short frames whose low bits look like ours."""
    decoder = CAN.decoder()
    foreign = [
        (0x110 | 1 << 31, b"\1" * 8),
        (0x111 | 1 << 30, b"\1" * 8),
        (0x110, b"\1" * 4),
        (0x7FF, b"\1" * 8),
    ]
    decoded = decoder.feed(b"".join(pack_frame(1, identifier, data) for identifier, data in foreign))
    assert decoded.segments == ()
    assert decoder.counts.bad_frames == decoder.counts.good_frames == 0
