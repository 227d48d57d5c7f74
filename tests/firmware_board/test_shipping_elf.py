"""The ELF that is flashed: built by PlatformIO, within its budgets, laid out as the chip needs it."""

import base64
import json
import re
import struct
import subprocess
import zlib
from dataclasses import dataclass
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile
from elftools.elf.sections import SymbolTableSection

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Chip:
    """What the manual of a chip says of its vectors and its flash.

    Attributes:
        positions: of the handlers, in the table of interrupt vectors.
        vectors: words of the table.
        slots: where the two begin.
        unit: bytes that the flash takes at once; a word of the header has so many for itself.
    """

    positions: dict[str, int]
    vectors: int
    slots: tuple[int, int]
    unit: int


F446 = Chip(  # RM0390
    {
        "serial_sent_handler": 17,
        "adc_handler": 18,
        "can1_tx_handler": 19,
        "can1_rx0_handler": 20,
        "can1_sce_handler": 22,
        "usart2_handler": 38,
        "tick_handler": 56,
    },
    vectors=113,
    slots=(0x08010000, 0x08020000),
    unit=4,
)
G474 = Chip(  # RM0440: two banks, the second at 0x08040000
    {
        "tick_handler": 11,
        "serial_sent_handler": 15,
        "adc_handler": 18,
        "fdcan1_it0_handler": 21,
        "fdcan1_it1_handler": 22,
        "usart2_handler": 38,
    },
    vectors=118,
    slots=(0x08010000, 0x08040000),
    unit=8,
)
BOARDS = {
    "nucleo_f446re": F446,
    "custom_f446re": F446,
    "nucleo_f446re_adxl355": F446,
    "nucleo_g474re": G474,
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
        self.chip = BOARDS[board]
        with (ROOT / ".pio" / "build" / board / "firmware.elf").open("rb") as file:
            elf = ELFFile(file)
            table = elf.get_section_by_name(".symtab")
            assert isinstance(table, SymbolTableSection)
            self.symbols = {symbol.name: symbol["st_value"] for symbol in table.iter_symbols()}
            text = elf.get_section_by_name(".text")
            assert text is not None
            self.text_at, self.text = text["sh_addr"], text.data()
            self.data = elf.get_section_by_name(".data").data()
            self.header = elf.get_section_by_name(".header").data()
            self.sections = {s.name: (s["sh_addr"], s["sh_size"]) for s in elf.iter_sections()}


@pytest.fixture(params=list(BOARDS))
def elf(build: str, request: pytest.FixtureRequest) -> Elf:
    return Elf(request.param)


def test_all_boards_are_within_their_budgets(build: str) -> None:
    assert build.count("heap   none") == len(BOARDS)
    assert "OVER BUDGET" not in build
    for board in BOARDS:
        assert board in build


def test_every_interrupt_stands_at_its_position(elf: Elf) -> None:
    assert elf.text_at == elf.symbols["vectors"] == 0x08010200, (
        "the loader starts it there, behind the header"
    )
    assert elf.text_at % 512 == 0, (
        "VTOR takes a table of up to 128 words at multiples of 512 bytes (Armv7-M B3.2.5)"
    )
    words = struct.unpack_from(f"<{elf.chip.vectors}I", elf.text)
    assert words[0] == elf.symbols["linker_stack_top"]
    assert words[1] == elf.symbols["reset_handler"] | 1
    assert words[2] == elf.symbols["nmi_handler"] | 1
    assert set(words[3:7]) == {elf.symbols["fault_handler"] | 1}
    unexpected = elf.symbols["unexpected_handler"] | 1
    expected = {16 + position: elf.symbols[name] | 1 for name, position in elf.chip.positions.items()}
    for i in range(7, elf.chip.vectors):
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


def test_everything_lies_where_the_map_of_the_flash_has_it(elf: Elf) -> None:
    """F446: sectors of 16 KiB at 0x08000000, 64 KiB at 0x08010000, 128 KiB at 0x08020000 (RM0390 3.3)."""
    _, data_size = elf.sections[".data"]
    loader_at, loader_size = elf.sections[".loader"]
    assert loader_at == elf.symbols["loader_vectors"] == 0x08000000, "the processor starts there"
    assert loader_size <= 16 * 1024
    assert elf.sections[".header"] == (elf.chip.slots[0], 6 * elf.chip.unit)
    assert len(elf.text) + data_size <= 32 * 1024
    assert elf.sections[".void"] == (elf.chip.slots[1], elf.chip.unit)


def test_the_header_tells_the_image_and_asks_for_no_trial(elf: Elf) -> None:
    rest = elf.chip.unit - 4
    words = [struct.unpack_from("<I", elf.header, n * elf.chip.unit)[0] for n in range(6)]
    mark, length, crc, sequence, tried, confirmed = words
    assert (mark, sequence, tried, confirmed) == (0x31544C53, 1, 0, 0)
    image = elf.text + elf.data
    image += b"\xff" * (-len(image) % elf.chip.unit)
    assert length == len(image)
    assert crc == zlib.crc32(image)
    for n, word in enumerate(words):
        behind = elf.header[n * elf.chip.unit + 4 : (n + 1) * elf.chip.unit]
        # Erased, or all zero with the word: nothing else may be written over such a place.
        assert behind == (b"\xff" * rest if word else b"\0" * rest)


@pytest.mark.parametrize("board", list(BOARDS))
def test_the_loader_calls_nothing_outside_of_itself(build: str, board: str) -> None:
    """What it called in the image would be gone with the next update."""
    assert board in build
    loader = next((ROOT / ".pio" / "build" / board).rglob("loader.o"))
    named = subprocess.run(["arm-none-eabi-nm", "-u", loader], capture_output=True, text=True, check=True)
    assert named.stdout.split() == ["U", "linker_stack_top"]


@pytest.mark.parametrize("board", list(BOARDS))
def test_the_update_file_holds_both_images_and_names_its_build(build: str, board: str) -> None:
    assert board in build
    told = json.loads((ROOT / ".pio" / "build" / board / "firmware.impid").read_text())
    assert (told["impid_firmware"], told["board"]) == (1, board)
    head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True)
    assert told["commit"] == head.stdout[:8]
    for slot, start_of_slot in enumerate(BOARDS[board].slots):
        base = start_of_slot + 0x200
        image = base64.b64decode(told["images"][slot]["data"])
        assert zlib.crc32(image) == told["images"][slot]["crc32"]
        assert len(image) % BOARDS[board].unit == 0
        _, start = struct.unpack_from("<2I", image)
        assert base < start < base + len(image), "linked for its slot"


@pytest.mark.parametrize("board", list(BOARDS))
def test_each_board_has_the_identity_of_its_name(board: str) -> None:
    header = (ROOT / "firmware" / "boards" / board / "board.h").read_text()
    told = re.search(r"#define BOARD_ID 0x([0-9A-F]{8})u", header)
    assert told is not None
    assert int(told[1], 16) == zlib.crc32(board.encode())
