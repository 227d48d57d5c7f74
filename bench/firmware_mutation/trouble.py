"""Checks of how the binary comes back: resets, faults, lost clocks, settings in flash."""

import struct
from pathlib import Path

import numpy as np
from impid_host.wire.decoder import SerialDecoder

from firmware_mutation.session import Session, code
from hil_sim.board.elf.board import FAULT_STALLED
from hil_sim.board.elf.dma import EN
from hil_sim.board.elf.flash import LOCK, PGSERR, sector_range
from hil_sim.board.elf.image import flash
from hil_sim.board.elf.nvic import ICER
from hil_sim.board.elf.wiring import Wiring

DMA_ERROR, ADC_OVERRUN, CLOCK_LOST = 4, 3, 2  # fault_kind_t
SETTINGS_SECTORS = (2, 3)
TICK_IRQ = 56


def cause(name: str) -> int:
    return code("reset_cause", name, "STATUS_HEALTH")


def tells_resets_apart(image: Path, wiring: Wiring) -> None:
    """The cause of each reset, one after the other: none is left over from the one before."""
    session = Session(image, wiring)
    session.run(20)
    session.board.serial_receive(session.command("RESET"), session.board.now_us)
    session.run(60)
    assert SerialDecoder().feed(session.board.serial_take()).responses, "RESET is not answered"
    assert session.reset_cause() == cause("SOFTWARE"), "SOFTWARE"
    for name, hardware in (("PIN", "pin"), ("BROWN_OUT", "brown_out"), ("WATCHDOG", "iwdg")):
        session.board.soc.request_reset(hardware)
        assert session.reset_cause() == cause(name), name
    assert session.ask("LOG", "FAULT_COUNT") == 0, "a fault is logged"


def bites_when_the_main_loop_hangs(image: Path, wiring: Wiring) -> None:
    """watchdog.h: 4000 counts of 1/32 of 32 kHz."""
    session = Session(image, wiring)
    session.run(3900, np.full(3900, FAULT_STALLED, np.uint8))
    assert not session.board.reset_requested, "too early"
    session.run(250, np.full(250, FAULT_STALLED, np.uint8))
    session.board.soc.thread_held = False
    assert session.board.reset_requested, "too late"
    assert session.reset_cause() == cause("WATCHDOG"), "reset cause"


def bites_when_the_tick_stops(image: Path, wiring: Wiring) -> None:
    """A tick without an interrupt leaves the main loop nothing to refresh the watchdog for."""
    session = Session(image, wiring)
    session.board.soc.nvic.write(ICER + 4 * (TICK_IRQ // 32), 4, 1 << TICK_IRQ % 32)
    assert session.reset_cause() == cause("WATCHDOG")


def records(session: Session, kind: int) -> None:
    """The board resets with a fault of that kind in its log."""
    assert session.reset_cause() == cause("FAULT"), "the reset is not told as a fault"
    assert session.ask("LOG", "FAULT_KIND") == kind, "kind of fault"


def records_a_transfer_error(image: Path, wiring: Wiring) -> None:
    session = Session(image, wiring)
    session.run(20)
    session.board.soc.dmas["DMA2"].fail(0)
    session.run(5)
    assert session.board.reset_requested, "no reset"
    records(session, DMA_ERROR)


def records_an_overrun(image: Path, wiring: Wiring) -> None:
    session = Session(image, wiring)
    session.run(20)
    session.board.soc.dmas["DMA2"].streams[0].value["CR"] &= ~EN
    session.run(5)
    assert session.board.reset_requested, "no reset"
    records(session, ADC_OVERRUN)


def marks_counts_that_lost_step(image: Path, wiring: Wiring) -> None:
    """An encoder stream that stops is no longer in step with the conversions: an encoder fault."""
    for stream in (0, 1):
        session = Session(image, wiring)
        session.ask("START")
        session.run(20)
        session.board.soc.dmas["DMA1"].streams[stream].value["CR"] &= ~EN
        session.run(5)
        assert session.status().encoder_faults > 0, f"stream {stream}"


def records_a_processor_fault(image: Path, wiring: Wiring) -> None:
    session = Session(image, wiring)
    session.run(20)
    scb = session.board.soc.scb.value
    scb["CFSR"], scb["HFSR"], scb["BFAR"] = 0x8200, 0x4000_0000, 0x6000_1234
    session.board.soc.nvic.pend(3)
    session.run(5)
    records(session, 1)
    logged = [session.ask("LOG", f"FAULT_{word}") for word in ("CFSR", "HFSR", "ADDRESS")]
    assert logged == [0x8200, 0x4000_0000, 0x6000_1234], f"logged {[hex(word) for word in logged]}"
    assert session.ask("LOG", "FAULT_PSR") & 1 << 24, "stacked PSR"
    assert 20_000 < session.ask("LOG", "FAULT_UPTIME_US") < 40_000, "uptime"


def outlives_its_external_clock(image: Path, wiring: Wiring) -> None:
    """Lost on the way: a fault, then the internal clock. Absent at boot: the internal clock."""
    session = Session(image, wiring)
    session.run(20)
    session.board.soc.rcc.lose_hse()
    session.run(5)
    assert session.board.reset_requested, "no reset"
    records(session, CLOCK_LOST)
    assert session.status().clock_source == code("clock_source", "HSI", "STATUS_HEALTH"), "clock source"
    absent = Session(image, wiring, hse_present=False)
    assert absent.status().clock_source == code("clock_source", "HSI", "STATUS_HEALTH"), "clock source"
    assert absent.board.soc.schedule.frequency == 90e6, "frequency"


def drives_the_self_test(image: Path, wiring: Wiring) -> None:
    session = Session(image, wiring)
    seen = [session.board.self_test_pin]
    session.board.serial_receive(session.command("SELF_TEST"), session.board.now_us)
    for _ in range(80):
        session.run(10)
        seen.append(session.board.self_test_pin)
    assert (seen[0], any(seen), seen[-1]) == (False, True, False), "pin before, during, after"


def outside_of_settings(flash: memoryview) -> tuple[bytes, bytes]:
    """The loader before them and the firmware behind them."""
    begin, end = sector_range(SETTINGS_SECTORS[0])[0], sum(sector_range(SETTINGS_SECTORS[-1]))
    return bytes(flash[:begin]), bytes(flash[end:])


def keeps_settings(image: Path, wiring: Wiring) -> None:
    """Saved once, they are there after a reset; the flash is locked and the program whole."""
    session = Session(image, wiring)
    soc = session.board.soc
    before = outside_of_settings(soc.memory.flash)
    session.ask("SET", "CAN_KBPS", 500)
    session.ask("SET", "ACCEL_X_ZERO", 32123)
    soc.flash.value["SR"] |= PGSERR  # of a write that went astray before
    session.ask("SAVE")
    assert soc.flash.value["CR"] & LOCK, "the flash is left unlocked"
    session.board.serial_receive(session.command("RESET"), session.board.now_us)
    session.run(40)
    assert session.reset_cause() == cause("SOFTWARE"), "reset cause"
    kept = (session.ask("GET", "CAN_KBPS"), session.ask("GET", "ACCEL_X_ZERO"))
    assert kept == (500, 32123), f"kept {kept}"
    assert session.ask("GET", "BOOT_COUNT") == session.ask("INFO", "BOOT_ID") == 2, "boots counted"
    assert soc.can1.bit_rate == 500e3, f"{soc.can1.bit_rate:.0f} bit/s"
    assert outside_of_settings(soc.memory.flash) == before, "the program was touched"


def makes_room_in_full_sectors(image: Path, wiring: Wiring) -> None:
    """Sectors full of something else are erased before the first save, and hold it afterwards."""
    memory = flash(image)
    for sector in SETTINGS_SECTORS:
        start, size = sector_range(sector)
        memory.flash[start : start + size] = struct.pack("<I", 0x1234_5678) * (size // 4)
    before = outside_of_settings(memory.flash)
    session = Session(memory, wiring)
    assert session.ask("GET", "BOOT_COUNT") == 1, "first boot"
    session.ask("SET", "ACCEL_Y_ZERO", 31000)
    session.ask("SAVE")
    assert outside_of_settings(memory.flash) == before, "the program was touched"
    assert session.board.soc.resets == [], "a reset"
    again = Session(memory, wiring)
    assert again.ask("GET", "ACCEL_Y_ZERO") == 31000, "not kept"


TROUBLE = (
    tells_resets_apart,
    bites_when_the_main_loop_hangs,
    bites_when_the_tick_stops,
    records_a_transfer_error,
    records_an_overrun,
    marks_counts_that_lost_step,
    records_a_processor_fault,
    outlives_its_external_clock,
    drives_the_self_test,
    keeps_settings,
    makes_room_in_full_sectors,
)
