"""What the shipping binary does when the hardware under its samples fails, and that the second board samples too."""

from pathlib import Path

import numpy as np
import pytest
from elftools.elf.elffile import ELFFile

from hil_sim.board import layout
from hil_sim.board.elf.board import ElfBoard
from hil_sim.board.elf.dma import EN
from hil_sim.board.elf.memory import RAM_BASE
from hil_sim.board.elf.wiring import CUSTOM, NUCLEO, Wiring
from hil_sim.board.native import BoardConfig, NativeBoard
from hil_sim.board.wire import FrameReader, command, samples
from tests.hil_sim_elf.feed import readings

ADC_OVERRUN, DMA_ERROR, ASSERTION = 3, 4, 6  # fault_kind_t
LOG_KIND, LOG_PC = 65, 66  # words of the fault log
RING_HEAD = 4 + 256 * 24  # in impid_core_t: the sensor, then the samples of the ring, stand before it
BINARIES = {"firmware": NUCLEO, "custom_firmware": CUSTOM}


def rest(board: ElfBoard, ticks: int) -> None:
    board.run(np.full((ticks, 8, 2), 2048, np.uint16), np.zeros((ticks, 2), np.int32))


def fault_word(board: ElfBoard, item: int) -> int:
    rest(board, 5)
    board.serial_take()
    board.serial_receive(command(item, "LOG", item=item), board.now_us)
    rest(board, 20)
    kind = layout.code("BATCH", "kind", "RESPONSE")
    (answer,) = [frame for frame in FrameReader().feed(board.serial_take()) if frame.kind == kind]
    return int(layout.unpack("RESPONSE", np.frombuffer(answer.records, np.uint8).reshape(-1, 8))["value"][0])


def test_a_transfer_error_of_the_sampling_stream_is_recorded(firmware: Path) -> None:
    board = ElfBoard(firmware)
    rest(board, 20)
    board.soc.dmas["DMA2"].fail(0)
    rest(board, 3)
    assert board.soc.resets == ["software"]
    board.reboot()
    assert fault_word(board, LOG_KIND) == DMA_ERROR


def test_an_overrun_of_the_converters_is_recorded(firmware: Path) -> None:
    """A stream that stops without an error leaves a conversion that nobody fetches."""
    board = ElfBoard(firmware)
    rest(board, 20)
    board.soc.dmas["DMA2"].streams[0].value["CR"] &= ~EN
    rest(board, 3)
    assert board.soc.resets == ["software"]
    board.reboot()
    assert fault_word(board, LOG_KIND) == ADC_OVERRUN


def test_what_cannot_be_in_the_core_is_recorded_with_its_place(firmware: Path) -> None:
    """A bit that flips in the ring's index: more samples wait than the ring holds."""
    with firmware.open("rb") as stream:
        section = ELFFile(stream).get_section_by_name(".symtab")
        core = max(section.get_symbol_by_name("core"), key=lambda s: s["st_size"])  # not a pointer to it
        (push,) = section.get_symbol_by_name("impid_ring_push")
        head = core["st_value"] - RAM_BASE + RING_HEAD
        function = range(push["st_value"] & ~1, (push["st_value"] & ~1) + push["st_size"])
    board = ElfBoard(firmware)
    board.serial_receive(command(1, "START"), board.now_us)
    rest(board, 40)
    board.soc.memory.ram[head + 2] ^= 1
    rest(board, 3)
    assert board.soc.resets == ["software"]
    board.reboot()
    assert fault_word(board, LOG_KIND) == ASSERTION
    assert fault_word(board, LOG_PC) - 2 in function  # a return address


@pytest.mark.parametrize(("pulse_ns", "counts"), [(60, 0), (250, 1)])
def test_a_spike_on_an_encoder_line_at_the_latch_does_not_count(
    firmware: Path, pulse_ns: float, counts: int
) -> None:
    """sampling.c: pulses below 89 ns are ignored; 250 ns are a count of a fast encoder."""
    board = ElfBoard(firmware)
    board.serial_receive(command(1, "START"), board.now_us)
    rest(board, 40)
    timer = board.soc.timers["TIM5"]
    latch_s = 977.5e-6 - 100e-6 - pulse_ns / 2 * 1e-9  # a run ends 0.98 trigger periods after a tick
    board.soc.schedule.after_seconds(latch_s, lambda: timer.pulse(1, pulse_ns * 1e-9))
    rest(board, 40)
    got = samples(FrameReader().feed(board.serial_take())).enc2
    assert len(got) > 50
    assert np.abs(got.astype(np.int64)).sum() == counts


@pytest.mark.parametrize("name", BINARIES)
def test_either_board_gives_the_samples_of_the_native_core(name: str, request: pytest.FixtureRequest) -> None:
    wiring: Wiring = BINARIES[name]
    binary = ElfBoard(request.getfixturevalue(name), wiring=wiring)
    native = NativeBoard(BoardConfig(start_us=binary.next_tick_us))
    got = []
    for board in (native, binary):
        board.run(*readings(5, 1))
        board.serial_receive(command(1, "START"), board.next_tick_us - 450)
        board.run(*readings(400, 1, 5))
        got.append(samples(FrameReader().feed(board.serial_take())))
    count = min(len(stream.seq) for stream in got)
    assert count > 350
    for field in ("t_us", "seq", "ax", "ay", "enc1", "enc2", "flags"):
        np.testing.assert_array_equal(getattr(got[0], field)[:count], getattr(got[1], field)[:count], field)


def test_a_binary_on_the_other_board_takes_no_samples_of_it(firmware: Path) -> None:
    """Nothing of the world's x axis is on the pin that this binary converts."""
    with pytest.raises(Exception, match="nothing is wired to ADC channel 10"):
        ElfBoard(firmware, wiring=CUSTOM)
        rest(ElfBoard(firmware, wiring=CUSTOM), 5)
