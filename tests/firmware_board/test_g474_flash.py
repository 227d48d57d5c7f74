"""The second chip's flash driver: its code on its processor, the flash as RM0440 describes it.

Of the chip there are only the processor, the RAM and this flash: 64 bits at a time, written once between
erases, then to zero alone; pages of 2 KiB in two banks; keys before anything.
"""

import struct
import subprocess
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile
from elftools.elf.sections import SymbolTableSection
from unicorn import UC_ARCH_ARM, UC_HOOK_MEM_READ, UC_HOOK_MEM_WRITE, UC_MODE_MCLASS, UC_MODE_THUMB
from unicorn.arm_const import UC_ARM_REG_LR, UC_ARM_REG_SP
from unicorn.unicorn import Uc

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware"
RAM, RAM_BYTES = 0x2000_0000, 0x2_0000
FLASH, FLASH_BYTES, BANK_BYTES, PAGE_BYTES = 0x0800_0000, 512 * 1024, 256 * 1024, 2048
REGISTERS, IWDG = 0x4002_2000, 0x4000_3000
KEYR, SR, CR = 0x08, 0x10, 0x14
PG, PER, BKER, STRT, LOCK = 1 << 0, 1 << 1, 1 << 11, 1 << 16, 1 << 31
KEYS = [0x45670123, 0xCDEF89AB]
ERASED = 0xFFFF_FFFF_FFFF_FFFF
STOP = RAM + RAM_BYTES - 0x100


class Flash:
    """Keys, programming and erasing; what the manual forbids is an error."""

    def __init__(self, machine: Uc) -> None:
        self._machine = machine
        self._cr = LOCK
        self._keys: list[int] = []
        self._low: tuple[int, int] | None = None
        self.erased: list[int] = []
        self.programmed = 0
        self._before = bytes(8)
        self.trouble: list[str] = []
        machine.hook_add(UC_HOOK_MEM_WRITE, self._program, begin=FLASH, end=FLASH + FLASH_BYTES - 1)
        machine.hook_add(UC_HOOK_MEM_WRITE, self._write, begin=REGISTERS, end=REGISTERS + 0xFF)
        machine.hook_add(UC_HOOK_MEM_READ, self._read, begin=REGISTERS, end=REGISTERS + 0xFF)

    def _program(self, machine: Uc, _access: int, address: int, size: int, value: int, _data: object) -> None:
        value &= 0xFFFF_FFFF
        if not self._cr & PG or self._cr & LOCK or size != 4:
            self.trouble.append(f"write of {size} bytes at {address:#x} while PG is {self._cr & PG}")
        elif address % 8 == 0:
            self._low = (address, value)
        elif self._low is None or self._low[0] + 4 != address:
            self.trouble.append(f"second half at {address:#x} without its first")
        else:
            (before,) = struct.unpack("<Q", self._before)
            if before != ERASED and (self._low[1] or value):
                self.trouble.append(f"written over {before:#x} at {address - 4:#x}")
            self._low = None
            self.programmed += 1
        if address % 8 == 0:
            self._before = bytes(machine.mem_read(address, 8))

    def _write(self, machine: Uc, _access: int, address: int, _size: int, value: int, _data: object) -> None:
        value &= 0xFFFF_FFFF
        if address - REGISTERS == KEYR:
            self._keys.append(value)
            if self._keys[-2:] == KEYS:
                self._cr &= ~LOCK
        elif address - REGISTERS == CR:
            if self._cr & LOCK:
                self.trouble.append("CR written while locked")
                return
            if self._low is not None:
                self.trouble.append("half of 64 bits was never written")
            self._cr = value & ~STRT
            if value & STRT and value & PER:
                page = (value >> 3 & 127) + (BANK_BYTES // PAGE_BYTES if value & BKER else 0)
                self.erased.append(page)
                machine.mem_write(FLASH + page * PAGE_BYTES, b"\xff" * PAGE_BYTES)

    def _read(self, machine: Uc, _access: int, address: int, _size: int, _value: int, _data: object) -> None:
        if address - REGISTERS == CR:
            machine.mem_write(address, struct.pack("<I", self._cr))
        elif address - REGISTERS == SR:
            machine.mem_write(address, bytes(4))


class Chip:
    """Calls functions of the program."""

    def __init__(self, program: Path) -> None:
        self._machine = machine = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        machine.mem_map(RAM, RAM_BYTES)
        machine.mem_map(FLASH, FLASH_BYTES)
        machine.mem_map(REGISTERS & ~0xFFF, 0x1000)
        machine.mem_map(IWDG & ~0xFFF, 0x1000)
        machine.mem_write(FLASH, b"\xff" * FLASH_BYTES)
        with program.open("rb") as stream:
            elf = ELFFile(stream)
            for segment in elf.iter_segments():
                if segment["p_type"] == "PT_LOAD":
                    machine.mem_write(segment["p_paddr"], segment.data())
            table = elf.get_section_by_name(".symtab")
            assert isinstance(table, SymbolTableSection)
            self.at = {symbol.name: symbol["st_value"] for symbol in table.iter_symbols()}
        self.flash = Flash(machine)

    def call(self, function: str, *asked: int) -> list[int]:
        """The words that it told."""
        self._machine.mem_write(self.at["asked"], struct.pack(f"<{len(asked)}I", *asked))
        self._machine.mem_write(self.at["told"], bytes(32))
        self._machine.reg_write(UC_ARM_REG_SP, STOP - 0x100)
        self._machine.reg_write(UC_ARM_REG_LR, STOP | 1)
        self._machine.emu_start(self.at[function] | 1, STOP)
        return list(struct.unpack("<8I", self._machine.mem_read(self.at["told"], 32)))

    def read(self, address: int, count: int) -> bytes:
        """What lies there."""
        return bytes(self._machine.mem_read(address, count))


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("g474")
    sources = [
        ROOT / "tests/firmware_board/g474_flash.c",
        FIRMWARE / "boards/stm32g474/flash.c",
        *(FIRMWARE / "core" / f"impid_{name}.c" for name in ("settings", "update", "crc32")),
    ]
    folders = ["boards/stm32g474", "boards/stm32", "core", "generated"]
    out = folder / "program.elf"
    subprocess.run(
        ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-std=c11", "-O2", "-Wall", "-Wextra", "-Werror",
         "-nostartfiles", "--specs=nano.specs", f"-Wl,-Ttext={RAM:#x}", "-Wl,-e,update",
         *(f"-I{FIRMWARE / name}" for name in folders), *map(str, sources), "-o", str(out)],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    return out


def test_settings_survive_hundreds_of_saves_and_boots(program: Path) -> None:
    chip = Chip(program)
    failed, value, *_ = chip.call("save_often", 500)
    assert chip.flash.trouble == []
    assert (failed, value) == (0, 1499)
    # Both sectors of four pages were used in turn, and no page of anything else.
    assert set(chip.flash.erased) == set(range(16, 24))
    assert chip.flash.programmed > 500
    used = [page for page in range(256) if chip.read(FLASH + page * PAGE_BYTES, PAGE_BYTES).strip(b"\xff")]
    assert set(used) <= set(range(16, 24))


@pytest.mark.parametrize("words", [6, 7, 4096])
def test_an_update_is_written_in_pairs_and_found_by_the_next_boot(program: Path, words: int) -> None:
    chip = Chip(program)
    begun, refused, finished, whole, chosen, before, confirmed, after = chip.call("update", words)
    assert chip.flash.trouble == []
    assert (begun, refused, finished) == (0, 0, 0)
    assert (whole, chosen) == (1, 1)
    assert (before, confirmed, after) == (0, 0, 1)
    assert chip.flash.erased == list(range(128, 160)), "bank 2 alone"
    image = chip.read(FLASH + BANK_BYTES + 512, 4 * words)
    got = struct.unpack(f"<{words}I", image)
    assert got[0] == 0
    assert got[2:] == tuple(n * 2654435761 % 2**32 for n in range(2, words))


def test_a_second_update_takes_the_place_of_the_first(program: Path) -> None:
    chip = Chip(program)
    chip.call("update", 40)
    told = chip.call("update", 24)
    assert chip.flash.trouble == []
    assert told[:5] == [0, 0, 0, 1, 1]
