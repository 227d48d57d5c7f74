"""Small programs for the emulated chip, compiled here: none of the firmware takes part in these tests."""

import subprocess
from pathlib import Path

from elftools.elf.elffile import ELFFile

from hil_sim.board.elf.memory import FLASH_BASE, Memory
from hil_sim.board.elf.soc import Soc

COMPILER = "arm-none-eabi-gcc"
FLAGS = [
    "-mcpu=cortex-m4",
    "-mthumb",
    "-mfloat-abi=hard",
    "-mfpu=fpv4-sp-d16",
    "-Os",
    "-nostdlib",
    "-ffreestanding",
]
VECTORS = 113
STACK_TOP = 0x2000_4000
RESULTS = 0x2000_1000
PROLOGUE = """
#include <stdint.h>
#define REG(address) (*(volatile uint32_t *)(address))
#define BYTE(address) (*(volatile uint8_t *)(address))
#define out ((volatile uint32_t *)0x20001000u)
void reset(void);
"""


def build(folder: Path, body: str, vectors: dict[int, str] | None = None) -> Memory:
    """Flash and RAM with a program whose entry is `void reset(void)`.

    Args:
        folder: for the files of the build.
        body: C, after PROLOGUE.
        vectors: functions of the body by exception number.
    """
    table = [f"[1] = reset, {''.join(f'[{n}] = {f}, ' for n, f in (vectors or {}).items())}"]
    declare = "".join(f"void {name}(void);" for name in (vectors or {}).values())
    source = folder / "snippet.c"
    source.write_text(
        f"{PROLOGUE}{body}\n{declare}\n"
        f'__attribute__((section(".vectors"), used)) void (*const table[{VECTORS}])(void) = '
        f"{{ [0] = (void (*)(void))0x{STACK_TOP:X}u, {table[0]} }};\n"
    )
    script = folder / "snippet.ld"
    script.write_text(
        "SECTIONS { . = 0x08000000; .text : { KEEP(*(.vectors)) *(.text*) *(.rodata*) }\n"
        "/DISCARD/ : { *(.ARM*) *(.comment) } }"
    )
    binary = folder / "snippet.elf"
    subprocess.run(
        [COMPILER, *FLAGS, "-T", str(script), str(source), "-o", str(binary), "-Wl,-e,reset"],
        check=True,
        capture_output=True,
        text=True,
    )
    memory = Memory()
    with binary.open("rb") as stream:
        for segment in ELFFile(stream).iter_segments():
            if segment["p_type"] == "PT_LOAD" and segment["p_filesz"]:
                memory.write_flash(segment["p_paddr"], segment.data())
    assert memory.read_bytes(FLASH_BASE, 4) == STACK_TOP.to_bytes(4, "little")
    return memory


def run(folder: Path, body: str, vectors: dict[int, str] | None = None, seconds: float = 0.01) -> Soc:
    """Builds and runs a program for a while from power-on."""
    soc = Soc(build(folder, body, vectors))
    soc.run_for(seconds)
    return soc


def results(soc: Soc, count: int) -> list[int]:
    """The first words of `out`."""
    data = soc.memory.read_bytes(RESULTS, 4 * count)
    return [int.from_bytes(data[4 * n : 4 * n + 4], "little") for n in range(count)]
