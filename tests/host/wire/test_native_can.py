"""The CAN decoder in C against the one in Python, byte for byte: a board's frames whole, lost, doubled, late
or changed, in pieces of any size."""

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from impid_host.samples import FLAG_RESET
from impid_host.wire import native
from impid_host.wire.can_frames import CAN_FRAME, CanBytesDecoder
from impid_host.wire.carrier import CAN
from impid_host.wire.messages import ACCEL, EPOCH, OPCODE, TIME
from impid_host.wire.tracker import Position
from numpy.typing import NDArray

from hil_sim.board.native import BoardConfig, NativeBoard
from tests.host.wire.told import told

RNG = np.random.default_rng(18)
TICKS, PER_RUN = 4000, 20
ASKED = {0: "START", 300: "PING", 900: "STATUS", 1500: "PING", 2600: "STOP", 2700: "START", 3600: "INFO"}


def ask(board: NativeBoard, number: int, opcode: str) -> None:
    frame = np.frombuffer(CAN.encode_command(number, OPCODE[opcode], 0, 0), dtype=CAN_FRAME)[0]
    board.can_receive(int(frame["identifier"]), frame["data"].tobytes(), board.now_us)


@lru_cache
def board_frames(boot_id: int = 9) -> NDArray[np.void]:
    """Four seconds of a board, with commands between; its index and its clock wrap inside."""
    config = BoardConfig(boot_id=boot_id, first_index=2**32 - 1000, start_us=2**32 - 700_000)
    board, rows = NativeBoard(config), []
    for tick in range(0, TICKS, PER_RUN):
        if tick in ASKED:
            ask(board, tick + 1, ASKED[tick])
        adc = RNG.integers(0, 4096, (PER_RUN, 8, 2)).astype(np.uint16)
        counts = RNG.integers(-(2**31), 2**31, (PER_RUN, 2)).astype(np.int32)
        board.run(adc, counts)
        stamp = tick * 1_000_000 + 10**9
        rows += [(stamp + n * 400_000, i, len(data), data) for n, (i, data) in enumerate(board.can_take())]
    frames = np.zeros(len(rows), CAN_FRAME)
    for n, (stamp, identifier, size, data) in enumerate(rows):
        frames[n] = (stamp, identifier, size, np.void(data.ljust(8, b"\0")))
    return frames


def some(fraction: float, count: int) -> NDArray[np.intp]:
    return np.flatnonzero(RNG.random(count) < fraction)


def set_words(frames: NDArray[np.void], at: NDArray[np.intp], change: int) -> NDArray[np.void]:
    """Those frames with these bits flipped."""
    out = frames.copy()
    words = np.frombuffer(frames["data"].tobytes(), "<u8").copy()
    words[at] ^= np.uint64(change)
    out["data"] = words.view("V8")
    return out


@lru_cache
def streams() -> dict[str, NDArray[np.void]]:
    whole = board_frames()
    count = len(whole)
    late = whole.copy()
    late["monotonic_ns"][count // 2 :] += 300_000_000
    late["monotonic_ns"][count // 2 + 1 :: 7] += 250_000_000
    foreign = np.insert(whole, some(0.05, count), whole[5])
    foreign["identifier"][some(0.1, len(foreign))] |= 1 << 31
    short = whole.copy()
    short["dlc"][some(0.02, count)] = 4
    kinds = whole["identifier"]
    accel, epoch, time = (np.flatnonzero(kinds == each.frame_id) for each in (ACCEL, EPOCH, TIME))
    shift = ACCEL.fields["flags"][0]
    return {
        "whole": whole,
        "lost": np.delete(whole, some(0.02, count)),
        "doubled": np.repeat(whole, 1 + (RNG.random(count) < 0.02)),
        "late": late,
        "foreign": foreign,
        "short": short,
        "reset": set_words(whole, accel[1200:1201], FLAG_RESET << shift),
        "fine": set_words(whole, accel[1300:1303], 1 << 5 << shift),
        "flipped": set_words(whole, some(0.01, count), 1 << 40),
        "dates": set_words(set_words(whole, time[7:9], 64), epoch[12:15], 1 << 33),
        "boots": np.concatenate([whole, board_frames(10), whole[: count // 3]]).astype(CAN_FRAME),
    }


def decoded(
    frames: NDArray[np.void], sizes: list[int], position: Position | None, *, in_c: bool
) -> list[object]:
    decoder, at = CanBytesDecoder(native=in_c), 0
    out: list[object] = []
    if position is not None:
        decoder.resume(position)
    for size in sizes:
        part = decoder.feed(frames[at : at + size].tobytes())
        at += size
        out += told(part, decoder.counts)
    return out


@pytest.mark.parametrize("name", streams())
@pytest.mark.parametrize("largest", [3, 60, 3000])
def test_both_decode_alike(name: str, largest: int) -> None:
    assert native.available, "build it: IMPID_SIM=1 python setup.py build_ext --inplace"
    frames = streams()[name]
    frames = frames[1700:3300] if largest == 3 else frames
    sizes: list[int] = []
    while sum(sizes) < len(frames):
        sizes.append(int(RNG.integers(1, largest + 1)))
    mine, theirs = (decoded(frames, sizes, None, in_c=in_c) for in_c in (True, False))
    assert mine == theirs


def test_a_stream_that_is_resumed_is_decoded_alike() -> None:
    frames = streams()["whole"][3000:]
    position = Position(boot_id=9, run=3, index=2**32 + 100, t_us=2**32 + 400_000)
    sizes = [97] * (len(frames) // 97 + 1)
    mine, theirs = (decoded(frames, sizes, position, in_c=in_c) for in_c in (True, False))
    assert mine == theirs


def test_statuses_taken_together_are_those_taken_one_by_one() -> None:
    for name, frames in streams().items():
        once, by_ten = CanBytesDecoder(native=False), CanBytesDecoder(native=False)
        mine = list(once.feed(frames.tobytes()).statuses)
        parts = [by_ten.feed(frames[at : at + 10].tobytes()) for at in range(0, len(frames), 10)]
        theirs = [status for part in parts for status in part.statuses]
        assert len(theirs) > 10, name
        assert mine == theirs, name


def test_most_of_a_whole_stream_goes_through_c(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else alike would mean nothing."""
    decoder = CanBytesDecoder(native=True)
    general = decoder._decoder.feed
    calls: list[object] = []

    def counted(_: object, *arguments: Any) -> Any:
        calls.append(arguments)
        return general(*arguments)

    monkeypatch.setattr(type(decoder._decoder), "feed", counted)
    frames = streams()["whole"]
    for at in range(0, len(frames), 100):
        decoder.feed(frames[at : at + 100].tobytes())
    assert len(calls) < 0.15 * len(frames) / 100
    assert decoder.counts.stored > 0.9 * (TICKS - 100)
