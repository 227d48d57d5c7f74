"""What the firmware's sources connect to what inside the chip, against the public description."""

import csv
import re

import pytest

from tests.register_facts import chip, header

BOARDS = ["nucleo_f446re", "custom_f446re", "nucleo_f446re_adxl355"]
SOURCES = header.F446.sources()
# Which signal of which peripheral a pin of the board header carries.
SIGNALS = {
    "ENCODER_1_A": ("TIM2", "CH1"), "ENCODER_1_B": ("TIM2", "CH2"), "ENCODER_2_A": ("TIM5", "CH1"),
    "ENCODER_2_B": ("TIM5", "CH2"), "SYNC": ("TIM4", "CH1"), "SERIAL_TX": ("USART2", "TX"),
    "SERIAL_RX": ("USART2", "RX"), "CAN_TX": ("CAN1", "TX"), "CAN_RX": ("CAN1", "RX"),
    "EDGE": ("TIM3", "CH1"),
}  # fmt: skip
# And of a board with a digital sensor.
DIGITAL = {
    "SPI_SCK": ("SPI2", "SCK"), "SPI_MISO": ("SPI2", "MISO"), "SPI_MOSI": ("SPI2", "MOSI"),
    "SPI_SYNC": ("TIM1", "CH2"),
}  # fmt: skip


def board(name: str) -> str:
    return (header.PORT.parent / name / "board.h").read_text(encoding="utf-8")


def pins(name: str) -> dict[str, str]:
    found = re.findall(r"#define BOARD_(\w+)\s+PIN\(GPIO(\w), (\d+)\)", board(name))
    return {signal: f"P{port}{number}" for signal, port, number in found}


def functions(peripheral: str, signal: str) -> dict[str, int | None]:
    """Alternate function by pin."""
    rows = chip.description("PERIPHERALS")[peripheral]["pins"]
    return {row["pin"]: row["af"] for row in rows if row["signal"] == signal}


def alternate_functions() -> dict[str, int]:
    """AF_TIM2 and the others, wherever they are defined."""
    text = "\n".join(SOURCES.values())
    return {name: int(value) for name, value in re.findall(r"\bAF_(\w+)\s*=?\s*(\d+)u?\b", text)}


def test_every_interrupt_has_its_number() -> None:
    numbers = dict(re.findall(r"IRQ_(\w+) = (\d+)", SOURCES["irq.h"]))
    told = {name: int(number) for name, number in numbers.items()}
    described = chip.description("INTERRUPTS")
    assert told.pop("COUNT") == max(described.values()) + 1
    assert len(told) >= 7
    assert told == {name: described[name] for name in told}


@pytest.mark.parametrize("name", BOARDS)
def test_every_pin_has_the_alternate_function_of_its_signal(name: str) -> None:
    used = pins(name)
    told = alternate_functions()
    signals = SIGNALS | (DIGITAL if "SPI_CS" in used else {})
    for signal, (peripheral, channel) in signals.items():
        assert functions(peripheral, channel)[used[signal]] == told[peripheral], (signal, used[signal])
    calls = re.findall(r"pin_alternate\(BOARD_(\w+), AF_(\w+),", "\n".join(SOURCES.values()))
    expected = {signal: peripheral for signal, (peripheral, _) in (SIGNALS | DIGITAL).items()}
    assert dict(calls) == expected


@pytest.mark.parametrize("name", BOARDS)
@pytest.mark.parametrize(("axis", "converter"), [("X", "ADC1"), ("Y", "ADC2")])
def test_the_accelerometer_is_on_the_channel_of_its_pin(name: str, axis: str, converter: str) -> None:
    channel = re.search(rf"BOARD_ADC_{axis}_CHANNEL (\d+)u", board(name))
    assert channel is not None
    assert pins(name)[f"ACCEL_{axis}"] in functions(converter, f"IN{channel[1]}")


def requests(peripheral: str, signal: str) -> set[tuple[str, int]]:
    """Streams that serve a request, and the channel that selects it."""
    rows = chip.description("PERIPHERALS")[peripheral]["dma_channels"]
    return {(row["channel"], row["request"]) for row in rows if row["signal"] == signal}


def test_every_stream_serves_the_request_that_its_channel_selects() -> None:
    started = re.findall(
        r"start_stream\(&(DMA\d)->S\[(\d)\], (\d)u, &(\w+)->(?:CDR|CCR(\d))", SOURCES["converters.c"]
    )
    assert len(started) == 3
    for controller, stream, channel, source, capture in started:
        peripheral, signal = (source, f"CH{capture}") if capture else ("ADC1", "ADC1")
        assert (f"{controller}_CH{stream}", int(channel)) in requests(peripheral, signal), source
    serial = SOURCES["serial_line.h"]
    channel = re.search(r"CHANNEL_USART2 (\d)u", serial)
    assert channel is not None
    for name, signal in (("reception", "RX"), ("transmission", "TX")):
        stream = re.search(rf"\*{name} = &(DMA\d)->S\[(\d)\]", serial)
        assert stream is not None
        assert (f"{stream[1]}_CH{stream[2]}", int(channel[1])) in requests("USART2", signal)


def test_the_settings_lie_in_sectors_of_their_own() -> None:
    chip_text = chip.F446.metadata()
    regions = re.findall(
        r"kind: MemoryRegionKind::Flash,\s+address: (0x[0-9a-f]+),\s+size: (\d+),.*?erase_size: (\d+)",
        chip_text, re.DOTALL,
    )  # fmt: skip
    sectors = [
        (int(start, 16) + place, int(erase))
        for start, size, erase in regions
        for place in (range(0, int(size), int(erase)) if int(erase) else ())
    ]
    assert len(sectors) == 8
    flash = SOURCES["flash.c"]
    first = int(re.search(r"FIRST_SECTOR\s+(\d+)u", flash)[1])  # type: ignore[index]
    address = int(re.search(r"FIRST_ADDRESS\s+(0x\w+)u", flash)[1], 16)  # type: ignore[index]
    assert sectors[first][0] == address
    assert {size for _, size in sectors[first : first + 2]} == {16384}


def test_the_pins_of_the_table_are_those_of_the_package_and_the_dac_is_not_5_v_tolerant() -> None:
    """On the F4 the two outputs of the DAC are the pins of structure TTa."""
    text = (header.PORT / "io_structure.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    assert {row["pin"] for row in rows} == chip.description("PINS")
    outputs = {row["pin"] for row in chip.description("PERIPHERALS")["DAC1"]["pins"]}
    assert {row["pin"] for row in rows if row["structure"] == "TTa"} == outputs
