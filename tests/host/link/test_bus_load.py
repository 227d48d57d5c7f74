"""A CAN bus at 1 Mbit/s carries the stream with 70 % to spare, full-range encoders and stuffing included."""

from functools import reduce

import numpy as np
from impid_host.wire.can_frames import CAN_FRAME
from impid_host.wire.carrier import CAN
from impid_host.wire.messages import OPCODE

from hil_sim.board.native import BoardConfig, NativeBoard

BITS_PER_S = 1_000_000
WORST_BITS = 135  # 8 data bytes, 11-bit identifier, gap included: Davis et al. 2007, eq. (1), 55 + 10 s
PINGS_PER_S = 10


def crc15(bits: list[int]) -> list[int]:
    """ISO 11898-1: x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1."""

    def step(register: int, bit: int) -> int:
        out = (register >> 14 & 1) ^ bit
        return ((register << 1) & 0x7FFF) ^ (0x4599 if out else 0)

    register = reduce(step, bits, 0)
    return [register >> n & 1 for n in range(14, -1, -1)]


def bits_on_the_bus(identifier: int, data: bytes) -> int:
    """Of a classic data frame with its stuff bits, delimiters, acknowledgement, end and gap."""
    head = [0, *(identifier >> n & 1 for n in range(10, -1, -1)), 0, 0, 0]
    body = [*head, *(len(data) >> n & 1 for n in range(3, -1, -1))]
    body += [byte >> n & 1 for byte in data for n in range(7, -1, -1)]
    body += crc15(body)
    stuffed, last, alike = 0, None, 0
    for bit in body:
        alike = alike + 1 if bit == last else 1
        last = bit
        if alike == 5:  # a bit of the other kind follows, and counts for what comes behind it
            stuffed, last, alike = stuffed + 1, 1 - bit, 1
    return len(body) + stuffed + 1 + 2 + 7 + 3


def a_second_of_frames(encoder: np.ndarray) -> list[tuple[int, bytes]]:
    board = NativeBoard(BoardConfig(boot_id=0xFFFF, first_index=2**32 - 500, start_us=2**32 - 500_000))
    rng = np.random.default_rng(1)

    def tell(number: int, opcode: str) -> tuple[int, bytes]:
        frame = np.frombuffer(CAN.encode_command(number, OPCODE[opcode], 0, 0), dtype=CAN_FRAME)[0]
        sent = int(frame["identifier"]), frame["data"].tobytes()
        board.can_receive(*sent, board.now_us)
        return sent

    board.run(np.full((10, 8, 2), 2048, np.uint16), np.zeros((10, 2), np.int32))
    tell(1, "START")
    board.can_take()
    frames = []
    for tenth in range(10):
        adc = rng.integers(0, 4096, (100, 8, 2)).astype(np.uint16)
        board.run(adc, encoder[100 * tenth : 100 * tenth + 100])
        frames += [tell(2 + tenth, "PING"), *board.can_take()]
    return frames


def test_a_known_frame_has_the_bits_that_the_standard_gives_it() -> None:
    """All zeros is the most stuffed head; alternating data is not stuffed at all inside the data."""
    assert bits_on_the_bus(0x555, b"\x55" * 8) < bits_on_the_bus(0, b"\0" * 8) <= WORST_BITS
    assert 111 <= bits_on_the_bus(0x555, b"\x55" * 8) <= 113  # 47 + 64, and a little in length and CRC


def test_load_with_full_range_encoders() -> None:
    encoder = np.random.default_rng(2).integers(-(2**31), 2**31, (1000, 2)).astype(np.int32)
    frames = a_second_of_frames(encoder)
    assert 2 * 1000 + 20 + 80 + 2 * PINGS_PER_S - 15 <= len(frames) <= 2 * 1000 + 22 + 88 + 2 * PINGS_PER_S
    worst = len(frames) * WORST_BITS / BITS_PER_S
    real = sum(bits_on_the_bus(*frame) for frame in frames) / BITS_PER_S
    assert real < worst < 0.30
    assert 0.24 < real < 0.27


def test_load_with_encoders_that_stuff_the_most() -> None:
    for count in (0, -1):
        frames = a_second_of_frames(np.full((1000, 2), count, np.int32))
        assert sum(bits_on_the_bus(*frame) for frame in frames) / BITS_PER_S < 0.30
