"""What the shipping binary does when the world misbehaves: reset, starvation, lost clocks, power cuts."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from unicorn import UC_HOOK_EDGE_GENERATED

from hil_sim.board import layout
from hil_sim.board.elf.board import ElfBoard
from hil_sim.board.elf.budget import TickCounter
from hil_sim.board.elf.errors import PowerCut
from hil_sim.board.elf.flash import Cut
from hil_sim.board.elf.image import flash
from hil_sim.board.native import BoardConfig, NativeBoard
from hil_sim.board.protocol import Board
from hil_sim.board.wire import FrameReader, accepts_start, command, samples
from hil_sim.errors import SimError
from tests.hil_sim_elf.busy import busiest_share
from tests.hil_sim_elf.feed import readings

STATUS = [
    "SAMPLES",
    "LINK",
    "TIMING",
    "SENSORS",
    "COMMANDS",
    "HEALTH",
    "BUS",
    "LOSSES",
]  # in the order of identifiers


def rest(board: Board, ticks: int) -> None:
    board.run(np.full((ticks, 8, 2), 2048, np.uint16), np.zeros((ticks, 2), np.int32))


def status(board: ElfBoard) -> dict[str, int]:
    """The last STATUS of the next 150 ms."""
    board.serial_take()
    rest(board, 150)
    number = layout.code("BATCH", "kind", "STATUS")
    frames = [frame for frame in FrameReader().feed(board.serial_take()) if frame.kind == number]
    words = np.frombuffer(frames[-1].records, np.uint8).reshape(-1, 8)
    found: dict[str, int] = {}
    for place, name in enumerate(STATUS):
        found |= {k: int(v[0]) for k, v in layout.unpack(f"STATUS_{name}", words[place : place + 1]).items()}
    return found


def ask(
    board: ElfBoard, request: int, opcode: str, item: str | None = None, value: int = 0
) -> tuple[str, int]:
    """Sends a command. Returns the name of the result, and the value."""
    number = layout.code("COMMAND", "item", item) if item else 0
    board.serial_take()
    board.serial_receive(command(request, opcode, item=number, value=value), board.now_us)
    rest(board, 20)
    kind = layout.code("BATCH", "kind", "RESPONSE")
    frames = [frame for frame in FrameReader().feed(board.serial_take()) if frame.kind == kind]
    answer = layout.unpack("RESPONSE", np.frombuffer(frames[0].records, np.uint8).reshape(-1, 8))
    results = {
        layout.code("RESPONSE", "result", name): name
        for name in ("OK", "BUSY", "FAILED", "BAD_VALUE", "BAD_ITEM")
    }
    assert answer["request_id"][0] == request
    return results[int(answer["result"][0])], int(answer["value"][0])


def test_reset_command_boots_anew(firmware: Path) -> None:
    board = ElfBoard(firmware)
    _, before = ask(board, 1, "INFO", "BOOT_ID")
    board.serial_receive(command(2, "RESET"), board.now_us)
    rest(board, 100)
    assert board.reset_requested
    board.reboot()
    assert not board.reset_requested
    assert board.next_tick_us == 1000
    assert status(board)["reset_cause"] == layout.code("STATUS_HEALTH", "reset_cause", "SOFTWARE")
    assert ask(board, 1, "INFO", "BOOT_ID") == ("OK", before + 1)


def test_a_main_loop_that_stands_still_starves_the_watchdog(firmware: Path) -> None:
    board = ElfBoard(firmware)
    board.soc.thread_held = True
    rest(board, 3900)
    assert board.soc.resets == []
    rest(board, 200)  # 4001 counts of 32 / 32 kHz
    assert board.soc.resets == ["iwdg"]
    board.soc.thread_held = False
    board.reboot()
    assert status(board)["reset_cause"] == layout.code("STATUS_HEALTH", "reset_cause", "WATCHDOG")


def test_without_external_clock_it_runs_on_the_internal_one_and_says_so(firmware: Path) -> None:
    board = ElfBoard(firmware, hse_present=False)
    assert status(board)["clock_source"] == layout.code("STATUS_HEALTH", "clock_source", "HSI")
    assert board.soc.schedule.frequency == 90e6


def test_external_clock_lost_on_the_way(firmware: Path) -> None:
    """The NMI records a fault and resets; the next boot takes the internal clock."""
    board = ElfBoard(firmware)
    assert status(board)["clock_source"] == layout.code("STATUS_HEALTH", "clock_source", "HSE")
    board.soc.rcc.lose_hse()
    rest(board, 5)
    assert board.reset_requested
    board.reboot()
    after = status(board)
    assert after["clock_source"] == layout.code("STATUS_HEALTH", "clock_source", "HSI")
    assert after["reset_cause"] == layout.code("STATUS_HEALTH", "reset_cause", "FAULT")


def test_self_test_drives_the_pin(firmware: Path) -> None:
    board = ElfBoard(firmware)
    assert not board.self_test_pin
    board.serial_receive(command(1, "SELF_TEST"), board.now_us)
    seen = []
    for _ in range(100):
        rest(board, 10)
        seen.append(board.self_test_pin)
    assert any(seen)
    assert not seen[-1]


def test_unique_identity_is_the_chip_s(firmware: Path) -> None:
    board = ElfBoard(firmware, BoardConfig(uid=(0x11, 0x22, 0x33)))
    assert [ask(board, 1 + n, "INFO", f"UID_{n}")[1] for n in range(3)] == [0x11, 0x22, 0x33]


def test_late_interrupt_is_flagged_and_counted(firmware: Path) -> None:
    board = ElfBoard(firmware)
    rest(board, 50)
    faults = np.zeros(50, np.uint8)
    faults[10] = 4
    board.run(np.full((50, 8, 2), 2048, np.uint16), np.zeros((50, 2), np.int32), faults)
    found = status(board)
    assert found["late"] + found["overruns"] >= 1


def test_settings_survive_a_power_cut_at_any_byte_of_a_save(firmware: Path) -> None:
    """After each cut the board boots and holds the old value or the new one, whole."""
    old, new = 0x1234_5678, 0x0A0B_0C0D
    board = ElfBoard(firmware)
    assert ask(board, 1, "SET", "ACCEL_X_ZERO", 2048)[0] == "OK"
    old = 2048
    new = 2100
    assert ask(board, 2, "SAVE")[0] == "OK"
    image = bytes(board.soc.memory.flash)
    done = board.soc.flash.operations
    assert ask(board, 3, "SET", "ACCEL_X_ZERO", new)[0] == "OK"
    assert ask(board, 4, "SAVE")[0] == "OK"
    operations = board.soc.flash.operations - done
    assert operations > 1
    outcomes = set()
    for operation in range(operations):
        for kept in range(4):
            memory = flash(firmware)
            memory.flash[:] = image
            trial = ElfBoard(memory)
            assert ask(trial, 3, "SET", "ACCEL_X_ZERO", new)[0] == "OK"
            trial.soc.flash.cut = Cut(operations=operation, bytes_kept=kept)
            trial.serial_receive(command(4, "SAVE"), trial.now_us)
            with pytest.raises(PowerCut):
                rest(trial, 20)
            survivor = flash(firmware)
            survivor.flash[:] = memory.flash
            result, value = ask(ElfBoard(survivor), 5, "GET", "ACCEL_X_ZERO")
            assert result == "OK"
            assert value in (old, new), (operation, kept, value)
            outcomes.add(value)
    assert old in outcomes


@pytest.mark.parametrize(("skew_s", "differs"), [(0.5e-6, False), (2e-6, True)])
def test_a_latch_two_microseconds_off_would_show(firmware: Path, skew_s: float, differs: bool) -> None:
    """The encoders rest for 1 us around a tick: moved by less nothing changes, by more the counts do."""
    got = []
    for skew in (0.0, skew_s):
        board = ElfBoard(firmware)
        for timer in (board.soc.timers["TIM2"], board.soc.timers["TIM5"]):
            position = timer.position
            assert position is not None

            def skewed(position: Callable[[], int] = position, skew: float = skew) -> int:
                board._first_trigger_s -= skew  # noqa: B023
                try:
                    return position()
                finally:
                    board._first_trigger_s += skew  # noqa: B023

            timer.position = skewed
        board.run(*readings(5, 1))
        board.serial_receive(command(1, "START"), board.now_us)
        board.run(*readings(300, 1, 5))
        got.append(samples(FrameReader().feed(board.serial_take())).enc2)
    assert len(got[0]) > 250
    assert np.any(got[0] != got[1]) == differs


def test_samples_over_can_are_identical_too(firmware: Path) -> None:
    """ACCEL and ENCODER frames of five seconds, in order."""
    binary = ElfBoard(firmware)
    native = NativeBoard(BoardConfig(start_us=binary.next_tick_us))
    payload = layout.database().encode_message(
        "COMMAND",
        {"request_id": 1, "opcode": layout.code("COMMAND", "opcode", "START"), "item": 0, "value": 0},
        scaling=False,
    )
    got: list[list[tuple[int, bytes]]] = [[], []]
    for first in range(0, 5000, 50):
        adc, encoder = readings(50, 9, first)
        boards: tuple[Board, Board] = (native, binary)
        for board, frames in zip(boards, got, strict=True):
            board.run(adc, encoder)
            if first == 0:
                board.can_receive(0x100, payload, board.next_tick_us - 450)
            frames += [frame for frame in board.can_take() if frame[0] in (0x110, 0x111)]
    shorter = min(len(frames) for frames in got)
    assert shorter > 9800
    assert got[0][:shorter] == got[1][:shorter]


def test_worst_tick_is_under_a_quarter_of_its_period(firmware: Path) -> None:
    """The tick is the sampling interrupt. The main loop has all that is left of a period, and may spread a batch,
    a status and an answer that fall together over several; the busiest millisecond of all is watched too.
    """
    board = ElfBoard(firmware)
    counter = TickCounter(board)
    answered = []
    reader = FrameReader()
    for block in range(20):
        counter.run(*readings(100, 3, 100 * block))
        opcode = "START" if block == 0 else ("PING", "STATUS", "INFO")[block % 3]
        board.serial_receive(command(block + 1, opcode), board.now_us)
        frames = reader.feed(board.serial_take())
        answered += [frame for frame in frames if accepts_start(frame)]
    assert answered
    budget = counter.result()
    assert budget.frequency >= 84e6
    assert 0 < budget.worst_handler_share < 0.25
    assert budget.worst_share < 0.25, str(budget)
    assert np.median(budget.whole) > np.median(budget.handler) > 100
    assert 0.1 < busiest_share(lambda: ElfBoard(firmware), readings) < 0.25


@pytest.mark.parametrize("content", [None, b"not an ELF file", b"\x7fELF\x02\x01\x01" + bytes(57)])
def test_what_is_no_firmware_is_one_line(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "program.elf"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SimError, match=r"program\.elf: .*make firmware"):
        ElfBoard(path)


def test_code_is_translated_once(firmware: Path) -> None:
    """What streams has been translated after a second; doing it again takes most of the emulator's time."""
    board = ElfBoard(firmware)
    board.serial_receive(command(1, "START"), board.now_us)
    board.run(*readings(1000, 4))
    translated = []
    board.soc.cpu._uc.hook_add(UC_HOOK_EDGE_GENERATED, lambda _uc, block, *_: translated.append(block.pc))
    board.run(*readings(500, 4, 1000))
    assert len(samples(FrameReader().feed(board.serial_take())).seq) > 1400
    assert len(translated) < 50


def test_samples_helper_is_not_fooled_by_an_idle_board(firmware: Path) -> None:
    """Nothing streams before START."""
    board = ElfBoard(firmware)
    rest(board, 300)
    assert len(samples(FrameReader().feed(board.serial_take())).seq) == 0
