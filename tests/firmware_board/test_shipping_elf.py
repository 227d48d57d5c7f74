"""The ELF that is flashed: built by PlatformIO, within its budgets, laid out as the chip needs it."""

import struct
import subprocess
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile
from elftools.elf.sections import SymbolTableSection

ROOT = Path(__file__).resolve().parents[2]
BOARDS = ["nucleo_f446re", "custom_f446re"]
# RM0390, table of interrupt vectors: position by handler.
POSITIONS = {
    "dma1_stream6_handler": 17,
    "adc_handler": 18,
    "can1_tx_handler": 19,
    "can1_rx0_handler": 20,
    "can1_sce_handler": 22,
    "usart2_handler": 38,
    "dma2_stream0_handler": 56,
}


@pytest.fixture(scope="module")
def build() -> str:
    done = subprocess.run(
        ["scripts/firmware_build.sh"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


class Elf:
    """What the tests ask of an ELF."""

    def __init__(self, board: str) -> None:
        with (ROOT / ".pio" / "build" / board / "firmware.elf").open("rb") as file:
            elf = ELFFile(file)
            table = elf.get_section_by_name(".symtab")
            assert isinstance(table, SymbolTableSection)
            self.symbols = {symbol.name: symbol["st_value"] for symbol in table.iter_symbols()}
            text = elf.get_section_by_name(".text")
            self.text_at, self.text = text["sh_addr"], text.data()
            self.sections = {s.name: (s["sh_addr"], s["sh_size"]) for s in elf.iter_sections()}


@pytest.fixture(params=BOARDS)
def elf(build: str, request: pytest.FixtureRequest) -> Elf:
    return Elf(request.param)


def test_both_boards_are_within_their_budgets(build: str) -> None:
    assert build.count("heap   none") == len(BOARDS)
    assert "OVER BUDGET" not in build
    for board in BOARDS:
        assert board in build


def test_every_interrupt_stands_at_its_position(elf: Elf) -> None:
    assert elf.text_at == elf.symbols["vectors"] == 0x08000000, (
        "the processor reads the table at the start of flash"
    )
    words = struct.unpack_from("<113I", elf.text)
    assert words[0] == elf.symbols["linker_stack_top"]
    assert words[1] == elf.symbols["reset_handler"] | 1
    assert words[2] == elf.symbols["nmi_handler"] | 1
    assert set(words[3:7]) == {elf.symbols["fault_handler"] | 1}
    unexpected = elf.symbols["unexpected_handler"] | 1
    expected = {16 + position: elf.symbols[name] | 1 for name, position in POSITIONS.items()}
    for i in range(7, 113):
        assert words[i] == expected.get(i, unexpected), f"vector {i}"


def test_the_stack_is_lowest_and_what_outlives_a_reset_is_not_cleared(elf: Elf) -> None:
    stack_at, stack_size = elf.sections[".stack"]
    assert stack_at == 0x20000000, "below it there is no memory: an overflow faults"
    assert elf.symbols["linker_stack_top"] == stack_at + stack_size
    noinit_at, noinit_size = elf.sections[".noinit"]
    assert noinit_size > 0
    assert elf.symbols["linker_bss_end"] <= noinit_at
    assert noinit_at <= elf.symbols["kept"] < noinit_at + noinit_size
    assert noinit_at + noinit_size <= 0x20000000 + 16 * 1024


def test_the_program_keeps_out_of_the_settings_sectors(elf: Elf) -> None:
    _, data_size = elf.sections[".data"]
    assert elf.text_at + len(elf.text) + data_size <= 0x08008000
