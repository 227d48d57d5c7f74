"""What the shipping binary must do on the emulated chip. Each check is one property of the board."""

from collections.abc import Callable
from dataclasses import fields
from functools import partial
from pathlib import Path

import numpy as np
from impid_host.wire.decoder import SerialDecoder

from firmware_mutation.life import LIFE
from firmware_mutation.on_bench import ON_BENCH
from firmware_mutation.session import COMMAND_ID, UID, Session, code
from firmware_mutation.trouble import TROUBLE
from hil_sim.board.elf.wiring import Wiring
from hil_sim.board.native import BoardConfig, NativeBoard
from hil_sim.board.protocol import Board
from hil_sim.board.wire import FrameReader, samples

Check = Callable[[Path, Wiring], None]
SYNC_EDGE, ENCODER_FAULT = 2, 1
STREAM_TICKS = 400  # half of them over CAN: the low byte of an index does not wrap there
LINE_BAUD = 921600


def motion(ticks: int, first: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Noise on both axes; encoders that move fast enough for another instant to be another count."""
    rng = np.random.default_rng([7, first])
    t = (first + np.arange(ticks)) * 1e-3
    turn = np.stack([30_000 * np.sin(60 * t), 900_000 * np.sin(9 * t)], 1)
    return rng.integers(100, 4000, (ticks, 8, 2), dtype=np.uint16), np.rint(turn).astype(np.int32)


def comes_up(image: Path, wiring: Wiring) -> None:
    """Clock, supply, identity, cause of reset, LED, and nothing wrong at rest."""
    session = Session(image, wiring)
    soc = session.board.soc
    status = session.status()
    assert soc.schedule.frequency == 90e6, f"runs at {soc.schedule.frequency} Hz"
    assert status.clock_source == code("clock_source", "HSE", "STATUS_HEALTH"), "not on the external clock"
    assert status.reset_cause == code("reset_cause", "POWER_ON", "STATUS_HEALTH"), "reset cause"
    assert status.supply_mV == 3300, f"supply {status.supply_mV} mV"
    counters = (status.late, status.overruns, status.encoder_faults, status.bus_off, status.tx_errors)
    assert not any(counters), f"late, overruns, encoder faults, bus-off, errors: {counters}"
    assert tuple(session.ask("INFO", f"UID_{n}") for n in range(3)) == UID, "identity"
    assert abs(soc.usart2.baud / LINE_BAUD - 1) < 0.01, f"{soc.usart2.baud:.0f} baud"
    assert soc.can1.bit_rate == 1e6, f"{soc.can1.bit_rate:.0f} bit/s"
    port, pin = wiring.led
    lit = set()
    for _ in range(12):
        session.run(50)
        lit.add(soc.gpio[port].level(pin))
    assert lit == {False, True}, "the LED does not blink"
    assert soc.resets == [], f"resets: {soc.resets}"


def streams_over_serial(image: Path, wiring: Wiring) -> None:
    """Samples are those of the native core, marks included."""
    session = Session(image, wiring)
    native = NativeBoard(BoardConfig(start_us=session.board.next_tick_us))
    faults = np.zeros(STREAM_TICKS, np.uint8)
    faults[100] = SYNC_EDGE
    faults[200:205] = ENCODER_FAULT
    start = session.command("START")
    got = []
    for board in (native, session.board):
        board.run(*motion(5))
        board.serial_receive(start, board.next_tick_us - 450)
        board.run(*motion(STREAM_TICKS, 5), faults)
        got.append(samples(FrameReader().feed(board.serial_take())))
    count = min(len(stream.seq) for stream in got)
    assert count > STREAM_TICKS - 50, f"{count} samples"
    present = [{f.name for f in fields(stream) if getattr(stream, f.name) is not None} for stream in got]
    assert present[0] == present[1], (
        f"only one has {present[0] ^ present[1]}"
    )  # the third axis, if there is one
    for name in sorted(present[0]):
        ours, theirs = (getattr(stream, name)[:count] for stream in got)
        assert np.array_equal(ours, theirs), f"{name} differs"


def sample_frames(board: Board) -> list[tuple[int, bytes]]:
    """ACCEL and ENCODER frames since the last call."""
    return [frame for frame in board.can_take() if frame[0] in (0x110, 0x111)]


def index_of(frame: tuple[int, bytes]) -> tuple[int, int]:
    """Low byte of the sample's index, and 0 for its ACCEL or 1 for its ENCODER frame, which follows."""
    identifier, data = frame
    return (data[4], 0) if identifier == 0x110 else (data[7], 1)


def streams_over_can(image: Path, wiring: Wiring) -> None:
    """The frames are those of the native core; after a bus-off, which is counted, they go on."""
    session = Session(image, wiring)
    native = NativeBoard(BoardConfig(start_us=session.board.next_tick_us))
    got: list[list[tuple[int, bytes]]] = [[], []]
    start = session.can_command("START")
    boards: tuple[Board, Board] = (native, session.board)
    for board, frames in zip(boards, got, strict=True):
        board.can_receive(COMMAND_ID, start, board.next_tick_us - 450)
        for first in range(0, STREAM_TICKS // 2, 20):
            board.run(*motion(20, first))
            frames.extend(sample_frames(board))
    count = min(len(frames) for frames in got)
    assert count > STREAM_TICKS - 120, f"{count} frames"
    assert got[0][:count] == got[1][:count], "frames differ"
    for ticks in (21, 24):  # so that the mailboxes do not hold the same each time
        session.board.can_take()
        session.board.can_bus_off()
        session.run(ticks)
        late = [index_of(frame) for frame in sample_frames(session.board)]
        assert late == sorted(late), "frames that waited overtake each other"
    status = session.status()
    assert status.bus_off == 2, f"bus-off counted {status.bus_off} times"
    session.board.can_take()
    session.run(50)
    assert len(sample_frames(session.board)) > 90, "no frames after a bus-off"
    assert status.rejected == 0, f"{status.rejected} commands rejected"


def stamps_arrivals(image: Path, wiring: Wiring) -> None:
    """A PING's arrival is stamped to 2 us wherever it falls among ticks and transmissions."""
    session = Session(image, wiring)
    board = session.board
    board.serial_receive(session.command("START"), board.now_us)
    session.run(30)
    board.serial_take()
    decoder = SerialDecoder()
    arrivals, stamps = [], []
    for step in range(45):
        arrivals.append(board.next_tick_us + 1000 + 2 * step - 30)
        board.serial_receive(session.command("PING"), arrivals[-1])
        session.run(6)
        stamps += [pong.t2_us for pong in decoder.feed(board.serial_take()).pongs]
    late = np.array(stamps) - np.array(arrivals)
    assert late.min() >= -2, f"stamped {late.min()} us late"
    assert late.max() <= 2, f"stamped {late.max()} us late"


def swallows_spikes(image: Path, wiring: Wiring) -> None:
    """Pulses of 60 ns on sync and encoder lines are none; of 250 ns (encoders) and 1 us (sync) they are."""
    for pulse_s, encoder_pulse_s, expected in ((60e-9, 60e-9, 0), (1e-6, 250e-9, 1)):
        session = Session(image, wiring)
        board = session.board
        board.serial_receive(session.command("START"), board.now_us)
        session.run(40)
        schedule, timers = board.soc.schedule, board.soc.timers
        latch_s = 877.5e-6 - encoder_pulse_s / 2  # a run ends 0.98 trigger periods after a tick
        schedule.after_seconds(300e-6, partial(timers["TIM4"].pulse, 1, pulse_s))
        for name in ("TIM2", "TIM5"):
            for channel in (1, 2):
                pulse, at = timers[name].pulse, latch_s + (channel - 1) * 1e-3
                schedule.after_seconds(at, partial(pulse, channel, encoder_pulse_s))
        session.run(40)
        got = samples(FrameReader().feed(board.serial_take()))
        assert np.count_nonzero(got.flags & 0x10) == expected, "sync edges"
        for counts in (got.enc1, got.enc2):
            assert np.abs(counts.astype(np.int64)).sum() == 2 * expected, "encoder counts"


def holds_both_fault_lines_high(image: Path, wiring: Wiring) -> None:
    """Each encoder's fault line alone marks the samples."""
    session = Session(image, wiring)
    board = session.board
    session.ask("START")
    for port, pin in wiring.encoder_faults:
        before = session.status().encoder_faults
        board.soc.gpio[port].drive(pin, False)
        session.run(10)
        board.soc.gpio[port].drive(pin, True)
        assert session.status().encoder_faults > before, f"P{port}{pin} is not looked at"


SERIAL_SENT, CAN_SENT, CAN_ARRIVED, SERIAL_IDLE, TICK = (16 + irq for irq in (17, 19, 20, 38, 56))
RANK = {SERIAL_IDLE: 0, CAN_ARRIVED: 0, TICK: 1, SERIAL_SENT: 2, CAN_SENT: 2}


def preemptions(session: Session) -> set[tuple[int, int]]:
    """Pairs of exceptions of which the second entered while the first ran.

    One after the other is made pending, without a cause, whenever another one has just entered; all but the end
    of a serial transmission, whose handler believes that it has a cause.
    """
    soc = session.board.soc
    nested: set[tuple[int, int]] = set()
    running: list[int] = []

    def watch(poked: int) -> None:
        def on_exception(exception: int, entering: bool) -> None:
            if not entering:
                running.remove(exception)
                return
            if running:
                nested.add((running[-1], exception))
            running.append(exception)
            if len(running) == 1 and exception != poked:
                soc.schedule.after(1, lambda: soc.nvic.pend(poked))

        soc.on_exception = on_exception

    for poked in (SERIAL_IDLE, CAN_ARRIVED, TICK, CAN_SENT):
        watch(poked)
        session.run(25)
    soc.on_exception = None
    return nested


def keeps_priorities(image: Path, wiring: Wiring) -> None:
    """interrupts.h: stamps preempt the tick, the tick preempts transmission, and not the other way round."""
    over_serial, over_can = Session(image, wiring), Session(image, wiring)
    over_serial.ask("START")
    over_can.send_on_can("START")
    for session in (over_serial, over_can):
        session.run(10)
    seen = preemptions(over_serial) | preemptions(over_can)
    expected = {(low, high) for low in RANK for high in RANK if RANK[high] < RANK[low]}
    assert seen == expected, f"who preempts whom: {sorted(seen ^ expected)} against interrupts.h"


def takes_a_burst(image: Path, wiring: Wiring) -> None:
    """Commands without a pause between them, longer than the receive buffer, are all answered."""
    session = Session(image, wiring)
    frames = [session.command("GET", "CAN_KBPS") for _ in range(40)]
    session.board.serial_receive(b"".join(frames), session.board.now_us + 50 * len(frames[0]) * 11)
    session.run(60)
    answers = SerialDecoder().feed(session.board.serial_take()).responses
    assert len(answers) == len(frames), f"{len(answers)} of {len(frames)} answered"


CHECKS: tuple[Check, ...] = (
    comes_up,
    streams_over_serial,
    streams_over_can,
    stamps_arrivals,
    swallows_spikes,
    holds_both_fault_lines_high,
    keeps_priorities,
    takes_a_burst,
    *TROUBLE,
    *LIFE,
    *ON_BENCH,
)


# Which checks are asked first for the mistakes of a list: the likeliest to notice them.
FIRST = {"mutants_life": (*LIFE, *ON_BENCH)}


def first_failure(image: Path, wiring: Wiring, of_list: str = "") -> str | None:
    """The first check that the binary does not pass, and why; None if it passes all."""
    first = FIRST.get(of_list, ())
    for check in (*first, *(check for check in CHECKS if check not in first)):
        try:
            check(image, wiring)
        except Exception as error:
            text = str(error).strip().split("\n")[0]
            return f"{check.__name__.replace('_', ' ')}: {text or type(error).__name__}"
    return None
