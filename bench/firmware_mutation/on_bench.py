"""Checks of the bench test's part of the firmware, with its wire."""

import struct
from pathlib import Path

from firmware_mutation.session import Session
from firmware_mutation.trouble import cause
from hil_sim.board.elf.wire import Wire
from hil_sim.board.elf.wiring import Wiring

PERIOD = 11250  # clocks of 90 MHz from one trigger to the next
ENCODER_2_A = ("A", 0)
CUT_WORDS = 4


def counts_its_external_clock(image: Path, wiring: Wiring) -> None:
    """8 MHz by the internal oscillator, to one count of 120 ppm."""
    hertz = Session(image, wiring).ask("INFO", "EXTERNAL_CLOCK_HZ")
    assert abs(hertz - 8e6) <= 1000, f"{hertz} Hz"


def moves_its_edge(image: Path, wiring: Wiring) -> None:
    """An edge 11 ns before the trigger is counted, one 11 ns behind it is not; without the edge nothing moves."""
    session = Session(image, wiring)
    Wire(session.board).put(ENCODER_2_A)
    session.ask("BENCH", "BENCH_LEVELS", 0)
    counts = []
    for clock in (PERIOD - 100, PERIOD - 1, 1, 200, PERIOD):
        assert session.ask("BENCH", "BENCH_EDGE", clock) == PERIOD, "clocks from one trigger to the next"
        session.run(3)
        counts.append(session.ask("BENCH", "BENCH_COUNT_2"))
    assert counts == [0, 0, 1, 1, 0], f"counts {counts}"


def turns_encoders_by_pulls(image: Path, wiring: Wiring) -> None:
    session = Session(image, wiring)
    Wire(session.board)
    for levels in (0b0000, 0b0101, 0b1111, 0b1010, 0b0000):
        session.ask("BENCH", "BENCH_LEVELS", levels)
    counts = [session.ask("BENCH", f"BENCH_COUNT_{n}") for n in (1, 2)]
    assert counts == [4, 4], f"counts {counts}"


def hears_itself(image: Path, wiring: Wiring) -> None:
    """Frames come back, none leaves meanwhile, and the bus has the board again afterwards."""
    session = Session(image, wiring)
    session.run(30)
    session.board.can_take()
    session.ask("BENCH", "BENCH_CAN_LOOPBACK", 30)
    session.run(20)
    heard = {identifier for identifier, _ in session.board.can_take()}
    assert 0x100 not in heard, "the loopback is heard on the bus"
    back = session.ask("BENCH", "BENCH_CAN_LOOPED")
    assert back == 30, f"{back} of 30 frames came back"
    session.run(200)
    assert session.board.can_take(), "the board does not come back to the bus"


def settings_words(session: Session) -> tuple[int, ...]:
    """Both sectors of the settings as they stand in flash."""
    return struct.unpack("<8192I", session.board.soc.memory.flash[0x8000:0x10000])


def ends_badly_as_told(image: Path, wiring: Wiring) -> None:
    """A save cut off, a main loop that hangs."""
    session = Session(image, wiring)
    session.ask("SET", "ENCODER_1_CPR", 4096)
    session.ask("BENCH", "BENCH_CUT", CUT_WORDS)
    before = settings_words(session)
    session.board.serial_receive(session.command("SAVE"), session.board.now_us)
    session.run(20)
    assert session.board.reset_requested, "the save is not cut off"
    written = sum(now != then for now, then in zip(settings_words(session), before, strict=True))
    assert written == CUT_WORDS, f"{written} words written"
    assert session.reset_cause() == cause("SOFTWARE"), "cut by something else"
    assert session.ask("GET", "ENCODER_1_CPR") == 0, "a save that was cut off counts"
    session.board.serial_receive(session.command("BENCH", "BENCH_HANG"), session.board.now_us)
    assert session.reset_cause() == cause("WATCHDOG"), "no hang"


ON_BENCH = (
    counts_its_external_clock,
    moves_its_edge,
    turns_encoders_by_pulls,
    hears_itself,
    ends_badly_as_told,
)
