"""The shipping binary gives the samples of the native core, byte for byte, whatever happens besides."""

import struct
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from hil_sim.board import layout
from hil_sim.board.elf.board import ElfBoard
from hil_sim.board.native import BoardConfig, NativeBoard
from hil_sim.board.wire import Frame, FrameReader, command, samples
from tests.hil_sim_elf.feed import readings

SECONDS = 62
PING_EVERY = 100
CAN_STATUS = layout.database().encode_message(
    "COMMAND",
    {"request_id": 7, "opcode": layout.code("COMMAND", "opcode", "STATUS"), "item": 0, "value": 0},
    scaling=False,
)


def frames_of(kind: str, frames: list[Frame]) -> list[Frame]:
    number = layout.code("BATCH", "kind", kind)
    return [frame for frame in frames if frame.kind == number]


def records(kind: str, message: str, frames: list[Frame]) -> dict[str, np.ndarray]:
    joined = b"".join(frame.records for frame in frames_of(kind, frames))
    return layout.unpack(message, np.frombuffer(joined, np.uint8).reshape(-1, 8))


@pytest.fixture(scope="module")
def streams(firmware: Path) -> tuple[list[Frame], list[Frame], ElfBoard]:
    """Frames of the native board and of the binary over more than a minute; one tick is 1 ms.

    START; PING at 10 Hz; INFO and STATUS commands in between, one of them twice with the same request id;
    a CAN bus-off half-way; a sync edge and a lost encoder line on the way.
    """
    binary = ElfBoard(firmware)
    native = NativeBoard(BoardConfig(start_us=binary.next_tick_us))
    boards = (native, binary)
    readers = (FrameReader(), FrameReader())
    frames: tuple[list[Frame], list[Frame]] = ([], [])
    request = 1
    for first in range(0, 1000 * SECONDS, PING_EVERY):
        adc, encoder = readings(PING_EVERY, 5, first)
        faults = np.zeros(PING_EVERY, np.uint8)
        if first == 20_000:
            faults[40] = 2  # sync edge
            faults[60:70] = 1  # encoder fault
        for board in boards:
            board.run(adc, encoder, faults)
        if first == 30_000:
            binary.can_bus_off()
            binary.can_receive(0x100, CAN_STATUS, binary.now_us)
        opcode = {0: "START", 5: "INFO", 6: "STATUS"}.get(first // PING_EVERY % 10 if first else 0, "PING")
        if first and opcode == "START":
            opcode = "PING"
        data = command(request, opcode)
        for board in boards:
            board.serial_receive(data, board.next_tick_us - 450)
        request += opcode != "INFO" or first % 2000 == 500
        for reader, taken, kept in zip(readers, [b.serial_take() for b in boards], frames, strict=True):
            kept.extend(reader.feed(taken))
    assert [reader.damaged for reader in readers] == [0, 0]
    return frames[0], frames[1], binary


def test_sample_records_are_identical(streams: tuple[list[Frame], list[Frame], ElfBoard]) -> None:
    native, binary, _ = streams
    ours, theirs = samples(frames_of("SAMPLES", native)), samples(frames_of("SAMPLES", binary))
    count = min(len(ours.seq), len(theirs.seq))
    assert count >= 60_000
    assert ours.az is theirs.az is None
    for field in (field for field in fields(ours) if field.name != "az"):
        np.testing.assert_array_equal(
            getattr(ours, field.name)[:count], getattr(theirs, field.name)[:count], err_msg=field.name
        )
    batches = [
        b"".join(struct.pack("<IQ", f.first_index, f.t0_us) + f.records for f in frames_of("SAMPLES", stream))
        for stream in (native, binary)
    ]
    shorter = min(len(batch) for batch in batches)
    assert batches[0][:shorter] == batches[1][:shorter]


def test_the_run_held_what_it_was_to_hold(streams: tuple[list[Frame], list[Frame], ElfBoard]) -> None:
    """Wrap of the first counter, saturation, the sync edge, the encoder fault, no gap and no loss."""
    _, binary, board = streams
    got = samples(frames_of("SAMPLES", binary))
    assert np.abs(np.diff(got.enc1.astype(np.int64))).max() > 2**31
    assert np.all(np.diff(got.seq) == 1)
    assert np.all(np.diff(got.t_us) == 1000)
    assert np.count_nonzero(got.flags & 0x10) == 1
    assert np.count_nonzero(got.flags & 0x02) == 10
    assert np.any(got.flags & 0x01)
    assert board.soc.resets == []


def test_commands_are_answered_alike(streams: tuple[list[Frame], list[Frame], ElfBoard]) -> None:
    native, binary, _ = streams
    ours, theirs = (records("RESPONSE", "RESPONSE", stream) for stream in (native, binary))
    np.testing.assert_array_equal(ours["request_id"], theirs["request_id"])
    np.testing.assert_array_equal(ours["opcode"], theirs["opcode"])
    np.testing.assert_array_equal(ours["result"], theirs["result"])
    assert len(ours["opcode"]) > 100


def test_pings_are_stamped_within_microseconds_of_their_arrival(
    streams: tuple[list[Frame], list[Frame], ElfBoard],
) -> None:
    """The binary stamps at the idle interrupt, a byte time after the last byte, and takes that off."""
    native, binary, _ = streams
    ours, theirs = (records("PONG", "PONG", stream) for stream in (native, binary))
    assert len(ours["t2_us"]) == len(theirs["t2_us"]) > 400
    late = theirs["t2_us"].astype(np.int64) - ours["t2_us"].astype(np.int64)
    assert np.abs(late).max() <= 20


def test_bus_off_was_counted_and_recovered_from(streams: tuple[list[Frame], list[Frame], ElfBoard]) -> None:
    _, binary, board = streams
    last = np.frombuffer(frames_of("STATUS", binary)[-1].records, np.uint8).reshape(-1, 8)
    messages = sorted(
        (m.frame_id, m.name) for m in layout.database().messages if m.name.startswith("STATUS_")
    )
    place = [name for _, name in messages].index("STATUS_BUS")
    assert layout.unpack("STATUS_BUS", last[place : place + 1])["bus_off"][0] == 1
    assert not board.soc.can1.bus_off
    assert board.soc.can1.tec < 96
