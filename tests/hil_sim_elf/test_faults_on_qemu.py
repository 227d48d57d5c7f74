"""Faults that the binary takes itself, executed by QEMU: fault status as Armv7-M B3.2.15 and B3.2.16 encode it."""

import struct
from collections.abc import Iterator
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile
from elftools.elf.sections import SymbolTableSection

from hil_sim.board.elf.memory import RAM_BASE
from tests.hil_sim_elf.qemu_chip import QemuChip

CODE = RAM_BASE + 0x8000  # RAM that the binary does not use
FORCED = 1 << 30  # HFSR: escalated to a hard fault
UNDEFINSTR, INVSTATE = 1 << 16, 1 << 17
PRECISERR, STKERR, BFARVALID, IBUSERR = 1 << 9, 1 << 12, 1 << 15, 1 << 8
FAULT_PROCESSOR = 1
LOG = ("count", "kind", "pc", "lr", "psr", "cfsr", "hfsr", "address")


@pytest.fixture
def symbols(firmware: Path) -> dict[str, int]:
    with firmware.open("rb") as file:
        table = ELFFile(file).get_section_by_name(".symtab")
        assert isinstance(table, SymbolTableSection)
        return {symbol.name: symbol["st_value"] for symbol in table.iter_symbols()}


@pytest.fixture
def chip(firmware: Path, symbols: dict[str, int], tmp_path: Path) -> Iterator[QemuChip]:
    """In main(), its fault log made valid, about to start the clock."""
    with QemuChip(firmware, tmp_path) as chip:
        chip.run_to(symbols["clock_start"])
        yield chip


def log_after(chip: QemuChip, symbols: dict[str, int], code: bytes) -> dict[str, int]:
    """Executes instructions; the handler records and resets, and the next boot comes to the same place."""
    chip.write(CODE, code)
    chip.set_register("pc", CODE)
    chip.run_to(symbols["fault_record"])
    chip.run_to(symbols["clock_start"])
    words = struct.unpack(f"<{len(LOG)}I", chip.read(symbols["kept"], 4 * len(LOG)))
    return dict(zip(LOG, words, strict=True))


def test_nothing_is_logged_before(chip: QemuChip, symbols: dict[str, int]) -> None:
    assert chip.read(symbols["kept"], 4) == bytes(4)
    assert chip.register("sp") > symbols["linker_ram_start"]


@pytest.mark.parametrize(
    ("code", "offset", "cfsr", "address"),
    [
        ("00de", 0, UNDEFINSTR, 0),  # udf #0
        ("00bf aff30080 f0f700a0", 6, UNDEFINSTR, 0),  # nop; nop.w; udf.w #0
        ("4ff0c040 0168", 4, PRECISERR | BFARVALID, 0x6000_0000),  # mov r0, 0x60000000; ldr r1, [r0]
        ("4ff0c040 0160", 4, PRECISERR | BFARVALID, 0x6000_0000),  # the same, str
        ("4ff0e040 40f00100 0047", 0x7000_0000 - CODE, IBUSERR, 0),  # bx to 0x70000000, where nothing is
        ("0020 0047", None, INVSTATE, 0),  # movs r0, #0; bx r0: Arm state does not exist
    ],
)
def test_a_fault_leaves_its_cause_its_place_and_its_address(
    chip: QemuChip, symbols: dict[str, int], code: str, offset: int | None, cfsr: int, address: int
) -> None:
    log = log_after(chip, symbols, bytes.fromhex(code))
    assert (log["count"], log["kind"]) == (1, FAULT_PROCESSOR)
    assert (log["cfsr"], log["hfsr"], log["address"]) == (cfsr, FORCED, address)
    assert log["pc"] == (0 if offset is None else CODE + offset)
    assert bool(log["psr"] & 1 << 24) == (offset is not None)  # Thumb state, but for the branch that left it


def test_a_stack_that_overflows_is_recorded_and_eats_nothing(chip: QemuChip, symbols: dict[str, int]) -> None:
    """The stack is lowest in RAM: a recursion without end leaves the RAM, and even the stacking of the fault fails.
    Nothing was pushed that could be read, so there is no place; what lies above the stack is whole."""
    above = chip.read(symbols["linker_stack_top"], 64)
    log = log_after(chip, symbols, bytes.fromhex("ffb5 fff7fdff"))  # push {r0-r7, lr}; bl to itself
    assert (log["count"], log["kind"], log["pc"]) == (1, FAULT_PROCESSOR, 0)
    assert log["cfsr"] & (PRECISERR | STKERR) == PRECISERR | STKERR
    assert log["hfsr"] == FORCED
    assert RAM_BASE - 0x100 < log["address"] < RAM_BASE
    assert chip.read(symbols["linker_stack_top"], 64) == above


def test_faults_add_up_until_power_is_lost(chip: QemuChip, symbols: dict[str, int]) -> None:
    for count in (1, 2, 3):
        assert log_after(chip, symbols, bytes.fromhex("00de"))["count"] == count
