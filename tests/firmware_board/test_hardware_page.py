"""The pages and drawings say what board.h says: one wrong pin costs its reader a day."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BOARD = (ROOT / "firmware" / "boards" / "nucleo_f446re" / "board.h").read_text()
PINS = {
    name: f"P{port}{number}"
    for name, port, number in re.findall(r"#define BOARD_(\w+)\s+PIN\(GPIO(\w), (\d+)\)", BOARD)
}
# What docs/hardware.md calls each of them.
WORDS = {
    "ACCEL_X": "accelerometer x",
    "ACCEL_Y": "accelerometer y",
    "SELF_TEST": "self-test of the accelerometer",
    "ENCODER_1_A": "encoder 1, A",
    "ENCODER_1_B": "encoder 1, B",
    "ENCODER_2_A": "encoder 2, A",
    "ENCODER_2_B": "encoder 2, B",
    "ENCODER_1_FAULT": "encoder 1, fault",
    "ENCODER_2_FAULT": "encoder 2, fault",
    "SYNC": "sync",
    "CAN_TX": "CAN transmit",
    "CAN_RX": "CAN receive",
    "LED": "LED LD2",
    "EDGE": "edge of the bench test",
}


def rows(page: str) -> dict[str, str]:
    """Pin by purpose, from the page's table of the first board."""
    text = (ROOT / page).read_text(encoding="utf-8").split("## Pins")[1].split("\n## ")[0]
    return {
        row[2].strip(): row[0].strip() for row in re.findall(r"^\| (P[^|]*)\|([^|]*)\|([^|]*)\|", text, re.M)
    }


def test_every_pin_is_known_to_this_test() -> None:
    assert set(PINS) == set(WORDS) | {"SERIAL_TX", "SERIAL_RX"}
    assert len(set(PINS.values())) == len(PINS), "a pin carries two signals"


@pytest.mark.parametrize("name", sorted(WORDS))
def test_the_page_names_the_pin_of_the_header(name: str) -> None:
    assert rows("docs/hardware.md")[WORDS[name]] == PINS[name]


OTHERS = {
    "nucleo_f446re_adxl355": (
        "## ADXL355 in place of the ADXL203",
        ("SPI_CS", "SPI_SCK", "SPI_MISO", "SPI_MOSI", "SPI_SYNC"),
    ),
    "nucleo_g474re": ("## Nucleo-G474RE", ("ENCODER_1_FAULT", "CAN_TX", "CAN_RX")),
}  # fmt: skip


@pytest.mark.parametrize("board", OTHERS)
def test_the_page_names_what_another_board_has_elsewhere(board: str) -> None:
    heading, signals = OTHERS[board]
    header = (ROOT / "firmware" / "boards" / board / "board.h").read_text(encoding="utf-8")
    found = re.findall(r"#define BOARD_(\w+)\s+PIN\(GPIO(\w), (\d+)\)", header)
    used = {name: f"P{port}{number}" for name, port, number in found}
    differing = {name for name, pin in used.items() if PINS.get(name) != pin}
    assert differing == set(signals)
    section = (ROOT / "docs" / "hardware.md").read_text(encoding="utf-8").split(heading)[1].split("\n## ")[0]
    for name in signals:
        assert re.search(rf"^\| {used[name]} \|", section, re.M), name


def test_the_drawing_shows_every_pin_that_is_wired() -> None:
    drawing = (ROOT / "docs" / "img" / "hardware-wiring.svg").read_text(encoding="utf-8")
    for name in set(WORDS) - {"LED", "EDGE"}:
        assert PINS[name] in drawing, name


def test_the_register_page_lists_every_pin() -> None:
    page = (ROOT / "firmware" / "boards" / "nucleo_f446re" / "README.md").read_text(encoding="utf-8")
    for name, pin in PINS.items():
        assert re.search(rf"\b{pin}\b", page), name
