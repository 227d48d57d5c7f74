"""The board in this process through its Python face: the bus, the line between ticks, and resets."""

import struct
from dataclasses import replace
from mmap import mmap
from pathlib import Path

import numpy as np
import pytest

from hil_sim.board import layout
from hil_sim.board.native import TICK_US, BoardConfig, NativeBoard, new_flash
from hil_sim.board.wire import FrameReader, command

ACCEL, ENCODER, TIME, EPOCH = 0x110, 0x111, 0x118, 0x119
STATUS = range(0x120, 0x128)


def run(board, ticks, first=0):
    counts = np.arange(first, first + ticks, dtype=np.int32)
    board.run(np.full((ticks, 8, 2), 2048, dtype=np.uint16), np.stack([counts, -counts], axis=1))


def can_command(opcode, request_id=1):
    fields = {
        "request_id": request_id,
        "opcode": layout.code("COMMAND", "opcode", opcode),
        "item": 0,
        "value": 0,
    }
    return layout.database().encode_message("COMMAND", fields, scaling=False)


def signals(frames, message):
    description = layout.database().get_message_by_name(message)
    return [
        description.decode(data, decode_choices=False)
        for number, data in frames
        if number == description.frame_id
    ]


def test_a_sample_is_two_frames_with_the_readings_of_its_tick():
    board = NativeBoard(BoardConfig(boot_id=9, can_frames_per_ms=7))
    run(board, 10)
    board.can_receive(0x100, can_command("START"), 9500)
    run(board, 500, first=10)
    frames = board.can_take()
    accel, encoder = signals(frames, "ACCEL"), signals(frames, "ENCODER")
    (answer,) = signals(frames, "RESPONSE")
    assert answer["result"] == 0
    assert [row["index_low16"] for row in accel] == list(range(len(accel)))
    assert [row["index_low8"] for row in encoder] == [i % 256 for i in range(len(encoder))]
    # A sample belongs to the tick two before the one that completes it: the first after START is tick 8.
    assert [row["enc1_low28"] for row in encoder] == [8 + i for i in range(len(encoder))]
    assert {row["ax"] for row in accel} == {16 * 2048}
    assert len(encoder) >= 499
    times, epochs = signals(frames, "TIME"), signals(frames, "EPOCH")
    assert [row["t_us"] for row in times] == [8000 + 100_000 * i for i in range(len(times))]
    assert {row["boot_id"] for row in epochs} == {9}
    assert all(
        len(signals(frames, message.name)) >= 5
        for message in layout.database().messages
        if message.frame_id in STATUS
    )


def test_the_bus_carries_no_more_than_its_rate():
    """7 frames a millisecond: the eighth answer waits for the next."""
    board = NativeBoard(BoardConfig(can_frames_per_ms=7))
    for request in range(1, 11):
        board.can_receive(0x100, can_command("INFO", request), 0)
    board.advance(999)
    assert len(board.can_take()) == 6
    board.advance(1000)
    assert len(board.can_take()) == 1
    assert board.lines_idle_us == 1000 + 429  # three frames of 142.86 us
    board.advance(1429)
    assert len(board.can_take()) == 3


def test_a_bus_off_loses_what_waits_and_is_counted():
    board = NativeBoard(BoardConfig(can_frames_per_ms=7))
    run(board, 1)
    for request in range(1, 6):
        board.can_receive(0x100, can_command("INFO", request), 100)
    board.can_bus_off()
    run(board, 200, first=1)
    frames = board.can_take()
    assert signals(frames, "RESPONSE") == []
    assert {row["bus_off"] for row in signals(frames, "STATUS_BUS")} == {1}


@pytest.mark.parametrize(("rate", "expected"), [(92, 370), (11, 3091)])
def test_a_pong_has_left_when_its_last_byte_has(rate, expected):
    board = NativeBoard(BoardConfig(serial_bytes_per_ms=rate, start_us=5000))
    run(board, 1)
    board.serial_receive(command(5, "PING"), 5000)
    assert board.lines_idle_us == 5000 + expected  # 34 bytes
    board.advance(5000 + expected - 1)
    assert len(board.serial_take()) == 33
    board.advance(5000 + expected)
    assert board.serial_take() == b"\x00"
    assert board.next_tick_us == 5000 + TICK_US


def test_reset_is_asked_for_after_the_answer():
    board = NativeBoard(BoardConfig(serial_bytes_per_ms=0))
    run(board, 1)
    assert not board.reset_requested
    board.serial_receive(command(3, "RESET"), 500)
    assert board.reset_requested
    assert len(board.serial_take()) == 34


def setting(
    board: NativeBoard, request_id: int, opcode: str, item: int = 0, value: int = 0
) -> tuple[int, int]:
    """Result and value of the answer."""
    board.serial_receive(command(request_id, opcode, item=item, value=value), board.now_us)
    frames = FrameReader().feed(board.serial_take())
    return struct.unpack("<xxxBI", frames[-1].records)


def test_settings_survive_in_a_file_and_boots_share_them(tmp_path: Path) -> None:
    """A mapped file is the flash; `replace` makes the next boot of the same board."""
    path = tmp_path / "flash"
    path.write_bytes(new_flash())
    cpr, boots = 38, 32  # items of the message set
    with path.open("r+b") as file:
        config = BoardConfig(serial_bytes_per_ms=0, flash=mmap(file.fileno(), 0))
        first = NativeBoard(config)
        assert setting(first, 1, "SET", cpr, 8192) == (0, 8192)
        assert setting(first, 2, "SAVE") == (0, 0)
        second = NativeBoard(replace(config, boot_id=2))
        assert setting(second, 1, "GET", cpr) == (0, 8192)
        assert setting(second, 2, "GET", boots) == (0, 2)
    third = NativeBoard(BoardConfig(serial_bytes_per_ms=0, flash=bytearray(path.read_bytes())))
    assert setting(third, 1, "GET", cpr) == (0, 8192)
    assert setting(NativeBoard(BoardConfig(serial_bytes_per_ms=0)), 1, "GET", cpr) == (0, 0)


def test_a_flash_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="32768"):
        NativeBoard(BoardConfig(flash=bytearray(100)))
