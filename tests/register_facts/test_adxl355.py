"""The digital accelerometer's registers, in the firmware and in its model, against the public driver crate.

What that driver, `adxl355`, does not use was compared by eye with the maker's own driver in Zephyr
(drivers/sensor/adi/adxl355): SYNC 2 is external with interpolation, DATA_RDY is bit 0 of STATUS, STANDBY is
bit 0 of POWER_CTL, ST1 and ST2 are bits 0 and 1 of SELF_TEST, bit 7 of RANGE is I2C high speed.
"""

import re

import pytest

from hil_sim.board.elf import adxl355 as model
from tests.register_facts.chip import crate
from tests.register_facts.header import F446

FIRMWARE = F446.sources()["adxl355.c"]


def codes(text: str) -> dict[str, int]:
    """Enumerators with a value, of Rust and of C."""
    return {name: int(value, 0) for name, value in re.findall(r"\b(\w+) +=\s+(0x\w+|0b\d+|\d+)\b", text)}


def driver(file: str) -> str:
    return (crate("adxl355") / file).read_text(encoding="utf-8")


REGISTERS = codes(driver("register.rs"))
PARTID = REGISTERS["DEVID"]  # as the driver calls it
SETTINGS = ("FILTER", "SYNC", "RANGE", "POWER_CTL", "SELF_TEST")


@pytest.mark.parametrize("name", SETTINGS)
def test_where_a_setting_is(name: str) -> None:
    assert codes(FIRMWARE)[name] == REGISTERS[name]
    assert getattr(model, name) == REGISTERS[name]


def test_what_one_transfer_reads() -> None:
    """From the part's number on: its places are those of the registers."""
    told = codes(FIRMWARE)
    assert told["PARTID"] == model.PARTID == PARTID
    assert PARTID + told["AT_STATUS"] == model.STATUS == REGISTERS["STATUS"]
    assert PARTID + told["AT_AXES"] == model.XDATA3 == REGISTERS["XDATA3"]
    assert PARTID + told["BYTES"] - 1 == model.ZDATA1 == REGISTERS["ZDATA1"]
    assert REGISTERS["RESET"] == model.RESET


def test_what_is_written_and_expected() -> None:
    told, named = codes(FIRMWARE), codes(driver("conf.rs"))
    identity = re.search(r"EXPECTED_DEVICE_ID: u8 = (0x\w+)", driver("lib.rs"))
    assert identity is not None
    assert told["IDENTITY"] == model.IDENTITY[model.PARTID] == int(identity[1], 16)
    assert told["FILTER_1000_HZ"] == model.MODELLED[model.FILTER] == named["ODR_1000_Hz"]
    assert told["RANGE_2_G"] & 3 == model.MODELLED[model.RANGE] & 3 == named["_2G"]
