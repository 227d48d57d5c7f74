"""The binary for the ADXL355: over SPI, in step with the ticks, and what it makes of a sensor in trouble."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from hil_sim.board import layout
from hil_sim.board.elf.adxl355 import Adxl355
from hil_sim.board.elf.board import ElfBoard
from hil_sim.board.elf.budget import TickCounter
from hil_sim.board.elf.errors import EmulatorError, RuleViolation
from hil_sim.board.elf.wiring import NUCLEO, NUCLEO_ADXL355
from hil_sim.board.native import BoardConfig, NativeBoard
from hil_sim.board.protocol import Board
from hil_sim.board.wire import Frame, FrameReader, Samples, command, samples
from tests.hil_sim_elf import snippet
from tests.hil_sim_elf.busy import busiest_share
from tests.hil_sim_elf.feed import readings as analog_readings

SATURATED, LATE = 1, 4
MISSING = 0


def readings(ticks: int, seed: int, first: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Codes (ticks, 1, 3) that name their tick, and the counts of an arm that swings."""
    _, counts = analog_readings(ticks, seed, first)
    at = np.arange(first, first + ticks, dtype=np.uint32)
    return np.stack([at + 1, 0xFFFFE - at, at * 7919 % 0xFFFFD + 1], axis=1)[:, None].astype(
        np.uint32
    ), counts


def run(board: Board, ticks: int, first: int, reader: FrameReader) -> list[Frame]:
    board.run(*readings(ticks, 3, first))
    return reader.feed(board.serial_take())


def status(frames: list[Frame]) -> dict[str, int]:
    last = [frame for frame in frames if frame.kind == layout.code("BATCH", "kind", "STATUS")][-1]
    words = np.frombuffer(last.records, np.uint8).reshape(-1, 8)
    return {
        name: int(value[0])
        for place, part in ((2, "TIMING"), (3, "SENSORS"), (5, "HEALTH"))
        for name, value in layout.unpack(f"STATUS_{part}", words[place : place + 1]).items()
    }


@pytest.fixture
def board(digital_firmware: Path) -> ElfBoard:
    made = ElfBoard(digital_firmware, wiring=NUCLEO_ADXL355)
    made.run(*readings(3, 3))  # the sensor is set up in the first
    return made


def stream(board: Board, ticks: int) -> Samples:
    """From START, the first 3 ticks being over."""
    board.serial_receive(command(1, "START"), board.next_tick_us - 450)
    board.run(*readings(ticks, 3, 3))
    return samples(FrameReader().feed(board.serial_take()))


def test_samples_are_those_of_the_native_core(board: ElfBoard) -> None:
    native = NativeBoard(BoardConfig(start_us=1000, part="ADXL355"))
    native.run(*readings(3, 3))
    ours, theirs = stream(board, 1200), stream(native, 1200)
    assert len(ours.t_us) >= 1190
    for field in fields(Samples):
        left, right = getattr(ours, field.name), getattr(theirs, field.name)
        count = min(len(left), len(right))
        assert count >= 1190
        assert np.array_equal(left[:count], right[:count]), field.name


def test_the_reading_is_that_of_the_sync_before_the_tick(board: ElfBoard) -> None:
    """Codes name the tick at which they lie in the sensor: two ticks after the sample's own instant."""
    got = stream(board, 100)
    assert np.array_equal((got.ax >> 4) - 1, got.t_us // 1000 - 1 + 2)
    assert not (got.flags & SATURATED).any()


def test_the_self_test_switches_the_sensor(board: ElfBoard) -> None:
    board.serial_receive(command(1, "SELF_TEST"), board.now_us)
    level = np.array([0x90000, 0x70000, 0x60000], np.uint32)
    frames, driven, reader = [], 0, FrameReader()
    for _ in range(400):
        on = board.self_test_pin
        driven += on
        rise = np.array([76_800, 76_800, 384_000], np.uint32) if on else 0  # 0.3, 0.3 and 1.5 g
        board.run((level + rise)[None, None].astype(np.uint32), np.zeros((1, 2), np.int32))
        frames += reader.feed(board.serial_take())
    assert driven == pytest.approx(168, abs=2)
    assert status(frames)["self_test"] == layout.code("STATUS_HEALTH", "self_test", "PASSED")


def test_a_sensor_that_is_not_there_is_a_reading_at_the_rail(board: ElfBoard) -> None:
    assert board.sensor is not None
    board.serial_receive(command(1, "START"), board.next_tick_us - 450)
    reader = FrameReader()
    frames = run(board, 100, 3, reader)
    board.sensor.present = False
    frames += run(board, 50, 103, reader)
    board.sensor.present = True
    frames += run(board, 100, 153, reader)
    got = samples(frames)
    tick = got.t_us // 1000 - 1 + 2  # whose reading each sample carries
    lost = (tick >= 103) & (tick <= 153)  # the tick after sets it up
    assert ((got.flags & SATURATED) != 0).tolist() == lost.tolist()
    assert not got.az[lost].any()  # type: ignore[index]
    assert np.array_equal(got.ax[~lost] >> 4, tick[~lost] + 1)


def test_a_sensor_that_stands_still_is_not_read_twice(board: ElfBoard) -> None:
    """SYNC torn off: there is nothing new, and the old must not pass for it."""
    assert board.sensor is not None
    board.serial_receive(command(1, "START"), board.next_tick_us - 450)
    reader = FrameReader()
    frames = run(board, 50, 3, reader)
    frozen = board._latest_reading()
    board.sensor._latest = lambda: frozen
    frames += run(board, 60, 53, reader)
    got = samples(frames)
    tick = got.t_us // 1000 - 1 + 2
    assert ((got.flags & SATURATED) != 0).tolist() == (tick >= 53).tolist()


@pytest.mark.parametrize("held_s", [2.2e-3, 1.75e-3])
def test_a_tick_served_so_late_that_the_sensor_holds_the_next_is_missed(
    board: ElfBoard, held_s: float
) -> None:
    """By 1.3 ms, when another tick is due, and by 0.87 ms, behind the next SYNC; the ticks come at 0.88 ms."""
    board.serial_receive(command(1, "START"), board.next_tick_us - 450)
    reader = FrameReader()
    frames = run(board, 40, 3, reader)
    board.soc.interrupts_held = True
    board.soc.schedule.after_seconds(held_s, board._release_interrupts)
    frames += run(board, 200, 43, reader)
    got = samples(frames)
    assert not (got.flags & LATE).any()
    assert np.array_equal((got.ax >> 4) - 1, got.t_us // 1000 - 1 + 2)
    # One instant is missed, and two ticks refill what was.
    assert status(frames)["overruns"] == 3
    assert int(np.diff(got.seq.astype(np.int64)).max()) == 4


def test_tick_and_busiest_millisecond_keep_within_their_budget(
    board: ElfBoard, digital_firmware: Path
) -> None:
    board.serial_receive(command(1, "START"), board.next_tick_us - 450)
    counter = TickCounter(board)
    counter.run(*readings(300, 3, 3))
    assert counter.result().worst_handler_share < 0.25
    assert busiest_share(lambda: ElfBoard(digital_firmware, wiring=NUCLEO_ADXL355), readings) < 0.25


def test_the_program_for_the_analog_sensor_knows_no_spi(firmware: Path) -> None:
    analog = ElfBoard(firmware, wiring=NUCLEO)
    assert analog.soc.spi2.value["CR1"] == 0
    assert analog.soc.tim1.rise_s() is None


# --- the models by themselves -----------------------------------------------------------------------

SPI = """
#define CLOCKS REG(0x40023830u) = 2u; REG(0x40023840u) = 1u << 14;
#define PINS REG(0x40020424u) = 0x55500000u; REG(0x40020400u) = 0xA8000280u;
#define CR1 REG(0x40003800u)
#define SR REG(0x40003808u)
#define DR REG(0x4000380Cu)
"""


def test_spi_takes_eight_bits_a_byte(tmp_path: Path) -> None:
    """16 MHz, divided by 256: 128 us a byte; RXNE comes then, and the answer is the world's."""
    body = """
    void reset(void) { CLOCKS PINS
        CR1 = 1u << 2 | 7u << 3 | 3u << 8; CR1 |= 1u << 6;
        DR = 0xA5u; out[0] = SR & 1u; out[3] = 1u;
        while (!(SR & 1u)) out[1]++;
        out[2] = DR; out[3] = 2u; for (;;) { } }"""
    memory = snippet.build(tmp_path, SPI + body)
    soc = snippet.Soc(memory)
    heard: list[tuple[int, int]] = []
    soc.spi2.exchange = lambda byte, mode: heard.append((byte, mode)) or 0x3C  # type: ignore[func-returns-value]
    soc.run_for(125e-6)
    assert snippet.results(soc, 4)[3] == 1
    soc.run_for(20e-6)
    first, polls, answer, stage = snippet.results(soc, 4)
    assert (first, answer, stage) == (0, 0x3C, 2)
    assert polls > 10
    assert heard == [(0xA5, 0)]


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ("void reset(void) { CLOCKS CR1 = 0x344u; DR = 1u; for (;;) { } }", "no pin is switched to SCK"),
        ("void reset(void) { CLOCKS PINS CR1 = 0x304u; DR = 1u; for (;;) { } }", "SPE is clear"),
        ("void reset(void) { PINS CR1 = 0x344u; for (;;) { } }", "clock is gated"),
    ],
)
def test_spi_refuses_what_would_not_work(tmp_path: Path, body: str, says: str) -> None:
    with pytest.raises(RuleViolation, match=says):
        snippet.run(tmp_path, SPI + body)


def transfer(sensor: Adxl355, *to_it: int) -> list[int]:
    sensor.select(True)
    answer = [sensor.exchange(byte, 0) for byte in to_it]
    sensor.select(False)
    return answer


def test_the_part_s_registers() -> None:
    """Identity and reset values as the data sheet lists them, two's complement left-justified in 24 bits."""
    rises = [0]
    sensor = Adxl355(lambda: (rises[0], (0x80000, 0x80001, 0x7FFFF)))
    assert transfer(sensor, 0x00 << 1 | 1, 0, 0, 0)[1:] == [0xAD, 0x1D, 0xED]
    assert transfer(sensor, 0x2C << 1 | 1, 0, 0)[1:] == [0x81, 0x01]
    for address, value in ((0x28, 2), (0x2B, 2), (0x2D, 0)):
        transfer(sensor, address << 1, value)
    assert transfer(sensor, 0x04 << 1 | 1, 0)[1] == 0
    rises[0] = 1
    assert transfer(sensor, 0x04 << 1 | 1, 0)[1] == 1
    assert transfer(sensor, 0x08 << 1 | 1, *[0] * 9)[1:] == [0, 0, 0, 0x00, 0x00, 0x10, 0xFF, 0xFF, 0xF0]
    assert transfer(sensor, 0x04 << 1 | 1, 0)[1] == 0


def test_the_part_refuses_settings_in_measurement() -> None:
    sensor = Adxl355(lambda: (0, (0, 0, 0)))
    for address, value in ((0x28, 2), (0x2B, 2), (0x2D, 0)):
        transfer(sensor, address << 1, value)
    with pytest.raises(EmulatorError, match="outside standby"):
        transfer(sensor, 0x28 << 1, 0)
