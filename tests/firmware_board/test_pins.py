"""Every pin of the boards against the I/O structure of the chip's pin table."""

import csv
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BOARDS = ROOT / "firmware" / "boards"
# Inputs to which docs/hardware.md lets 5 V come, with their pull off.
FIVE_VOLT = {f"ENCODER_{n}_{line}" for n in (1, 2) for line in ("A", "B", "FAULT")} | {"SYNC"}
BOARD_NAMES = ["nucleo_f446re", "custom_f446re", "nucleo_f446re_adxl355"]
OUTPUTS = {"SELF_TEST", "LED", "SERIAL_TX", "CAN_TX", "EDGE"}


def structure(port: str = "stm32f446") -> dict[str, dict[str, str]]:
    text = (BOARDS / port / "io_structure.csv").read_text(encoding="utf-8")
    return {row["pin"]: row for row in csv.DictReader(re.sub("(?m)^#.*\n", "", text).splitlines())}


def pins(board: str) -> dict[str, str]:
    header = (BOARDS / board / "board.h").read_text(encoding="utf-8")
    found = re.findall(r"#define BOARD_(\w+)\s+PIN\(GPIO(\w), (\d+)\)", header)
    return {name: f"P{port}{number}" for name, port, number in found}


def test_the_table_is_whole() -> None:
    """LQFP64: 16 pins of A, 15 of B (PB11 is not led out), 16 of C, PD2, PH0 and PH1."""
    table = structure()
    count = {port: sum(pin[1] == port for pin in table) for port in "ABCDH"}
    assert count == {"A": 16, "B": 15, "C": 16, "D": 1, "H": 2}
    assert {row["structure"] for row in table.values()} == {"FT", "TTa"}


@pytest.mark.parametrize("board", BOARD_NAMES)
def test_each_pin_stands_what_comes_to_it(board: str) -> None:
    table, used = structure(), pins(board)
    assert len(set(used.values())) == len(used), "a pin carries two signals"
    assert set(used.values()) <= set(table)
    assert set(used) >= FIVE_VOLT | OUTPUTS
    for name in FIVE_VOLT:
        assert table[used[name]]["structure"] == "FT", f"{name} on {used[name]} is not 5 V tolerant"
    for name in OUTPUTS:
        assert "no source" not in table[used[name]]["note"], f"{name} on {used[name]}: 3 mA at most"
    for name, pin in used.items():
        assert "debug port" not in table[pin]["note"], f"{name} on {pin} locks the debugger out"


@pytest.mark.parametrize("board", BOARD_NAMES)
def test_the_page_warns_of_inputs_that_have_a_pull_from_reset_on(board: str) -> None:
    table, used = structure(), pins(board)
    held = {used[name] for name in FIVE_VOLT if table[used[name]]["reset_pull"] != "none"}
    page = (ROOT / "docs" / "hardware.md").read_text(encoding="utf-8")
    assert held == {"PA15"}
    assert "PA15 has its pull-up from reset" in page


def test_the_second_chip_s_pins_stand_what_comes_to_them() -> None:
    """Encoder 2 is on pins of 3.3 V there, and the page says so."""
    table, used = structure("stm32g474"), pins("nucleo_g474re")
    assert {row["structure"] for row in table.values()} == {"FT", "TT"}
    assert len(table) == 52
    assert len(set(used.values())) == len(used), "a pin carries two signals"
    assert set(used) >= FIVE_VOLT | OUTPUTS - {"EDGE"}, "a bench test has not been written for it"
    fragile = {name for name in FIVE_VOLT if table[used[name]]["structure"] != "FT"}
    assert fragile == {"ENCODER_2_A", "ENCODER_2_B"}
    for name, pin in used.items():
        for reason in ("debug port", "booted from", "crystal", "reset"):
            assert reason not in table[pin]["note"], f"{name} on {pin}: {reason}"
        assert name not in OUTPUTS or "no source" not in table[pin]["note"]
    page = (ROOT / "docs" / "hardware.md").read_text(encoding="utf-8")
    section = page.split("## Nucleo-G474RE")[1].split("\n## ")[0]
    assert "PA0 and PA1 stand 3.3 V only" in section
    held = {used[name] for name in FIVE_VOLT - fragile if table[used[name]]["reset_pull"] != "none"}
    assert held == {"PA15", "PB6"}
    for pin in held:
        assert re.search(rf"{pin} has its pull-(up|down) from reset", section), pin
