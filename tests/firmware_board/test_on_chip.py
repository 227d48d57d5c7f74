"""The shipping ELF on the emulated chip: what it keeps over resets, and how it comes back from trouble."""

import struct
import subprocess
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.frame import encode_command
from impid_host.wire.records import BoardStatus, Response

from hil_sim.board import layout
from hil_sim.board.elf.board import ElfBoard

ROOT = Path(__file__).resolve().parents[2]
ELF = ROOT / ".pio" / "build" / "nucleo_f446re" / "firmware.elf"
STALLED, SYNC_EDGE = 0x08, 0x02


@pytest.fixture(scope="module", autouse=True)
def built() -> None:
    subprocess.run(["scripts/pio.sh", "run", "--silent", "-e", "nucleo_f446re"], cwd=ROOT, check=True)


def code(signal: str, name: str, message: str = "COMMAND") -> int:
    return layout.code(message, signal, name)


class Bench:
    """A board on the emulator with a host's half of the conversation."""

    def __init__(self, *, hse_present: bool = True) -> None:
        self.board = ElfBoard(ELF, hse_present=hse_present)
        self.request_id = 0

    def run(self, ticks: int, faults: np.ndarray | None = None) -> None:
        quiet = np.full((ticks, 8, 2), 2048, np.uint16)
        self.board.run(quiet, np.zeros((ticks, 2), np.int32), faults)

    def ask(self, opcode: str, item: str | int = 0, value: int = 0) -> Response:
        self.request_id += 1
        number = code("item", item) if isinstance(item, str) else item
        frame = encode_command(self.request_id, code("opcode", opcode), number, value)
        self.board.serial_receive(frame, self.board.now_us + 50)
        self.run(10)
        answers = SerialDecoder().feed(self.board.serial_take()).responses
        (answer,) = [answer for answer in answers if answer.request_id == self.request_id]
        return answer

    def value(self, opcode: str, item: str | int = 0, value: int = 0) -> int:
        answer = self.ask(opcode, item, value)
        assert answer.result == code("result", "OK", "RESPONSE"), (opcode, item, answer)
        return int(answer.value)

    def send_on_can(self, opcode: str) -> None:
        self.request_id += 1
        command = struct.pack("<HBBI", self.request_id, code("opcode", opcode), 0, 0)
        self.board.can_receive(0x100, command, self.board.now_us + 50)

    def status(self) -> BoardStatus:
        self.run(110)
        return SerialDecoder().feed(self.board.serial_take()).statuses[-1]

    def reset(self) -> None:
        """By command, and boot again."""
        self.request_id += 1
        frame = encode_command(self.request_id, code("opcode", "RESET"), 0, 0)
        self.board.serial_receive(frame, self.board.now_us + 50)
        self.run(40)
        self.reboot()

    def reboot(self) -> None:
        assert self.board.reset_requested
        self.board.serial_take()
        self.board.reboot()


def test_settings_saved_outlive_a_reset_and_others_do_not() -> None:
    bench = Bench()
    assert bench.value("GET", "BOOT_COUNT") == 1, "the first boot of an erased chip"
    assert bench.value("SET", "CAN_KBPS", 500) == 500
    bench.value("SET", "ACCEL_X_ZERO", 32123)
    bench.value("SAVE")
    bench.value("SET", "ACCEL_X_ZERO", 5)
    assert bench.ask("SET", "CAN_KBPS", 123).result == code("result", "BAD_VALUE", "RESPONSE")
    bench.reset()
    assert bench.value("GET", "CAN_KBPS") == 500
    assert bench.value("GET", "ACCEL_X_ZERO") == 32123
    assert bench.value("INFO", "BOOT_ID") == bench.value("GET", "BOOT_COUNT") == 2
    assert bench.value("INFO", "RESET_CAUSE") == code("reset_cause", "SOFTWARE", "STATUS_HEALTH")


def test_the_bit_rate_saved_is_that_of_the_bus_after_the_reset() -> None:
    bench = Bench()
    # RM0390, bxCAN bit timing: f = 45 MHz / prescaler / (1 + TS1 + TS2).
    for kilobits in (1000, 500, 250):
        bench.value("SET", "CAN_KBPS", kilobits)
        bench.value("SAVE")
        bench.reset()
        bench.run(5)
        timing = bench.board.soc.can1.value["BTR"]
        quanta = 1 + ((timing >> 16 & 15) + 1) + ((timing >> 20 & 7) + 1)
        assert 45_000_000 / ((timing & 1023) + 1) / quanta == kilobits * 1000


def test_without_the_external_clock_it_runs_on_the_internal_one_and_says_so() -> None:
    bench = Bench(hse_present=False)
    assert bench.value("INFO", "CLOCK_SOURCE") == code("clock_source", "HSI", "STATUS_HEALTH")
    status = bench.status()
    assert (status.late, status.overruns) == (0, 0)


def test_a_clock_that_dies_is_recorded_and_the_next_boot_does_without_it() -> None:
    bench = Bench()
    assert bench.value("INFO", "CLOCK_SOURCE") == code("clock_source", "HSE", "STATUS_HEALTH")
    assert bench.value("LOG", "FAULT_COUNT") == 0
    bench.board.soc.rcc.lose_hse()
    bench.run(2)
    bench.reboot()
    assert bench.value("INFO", "RESET_CAUSE") == code("reset_cause", "FAULT", "STATUS_HEALTH")
    assert bench.value("INFO", "CLOCK_SOURCE") == code("clock_source", "HSI", "STATUS_HEALTH")
    assert (bench.value("LOG", "FAULT_COUNT"), bench.value("LOG", "FAULT_KIND")) == (1, 2)
    bench.reset()
    assert bench.value("INFO", "RESET_CAUSE") == code("reset_cause", "SOFTWARE", "STATUS_HEALTH")
    assert bench.value("LOG", "FAULT_COUNT") == 1, "the record stays readable"


def test_a_processor_fault_leaves_its_record() -> None:
    """A precise bus fault with a valid address, as Armv7-M B3.2.15 encodes it, escalated to a hard fault."""
    bench = Bench()
    bench.value("START")
    scb = bench.board.soc.scb.value
    scb["CFSR"], scb["HFSR"], scb["BFAR"] = 0x8200, 0x40000000, 0x60001234
    bench.board.soc.nvic.pend(3)
    bench.run(5)
    bench.reboot()
    assert bench.value("INFO", "RESET_CAUSE") == code("reset_cause", "FAULT", "STATUS_HEALTH")
    assert bench.value("LOG", "FAULT_KIND") == 1
    assert bench.value("LOG", "FAULT_CFSR") == 0x8200
    assert bench.value("LOG", "FAULT_HFSR") == 0x40000000
    assert bench.value("LOG", "FAULT_ADDRESS") == 0x60001234
    assert 0x08010200 <= bench.value("LOG", "FAULT_PC") < 0x08018200, "in the image of slot 0"
    assert bench.value("LOG", "FAULT_PSR") & 0x01000000, "Thumb state of the stacked frame"
    assert 10_000 <= bench.value("LOG", "FAULT_UPTIME_US") <= 20_000


def test_what_a_reset_cut_off_is_counted_by_the_next_boot() -> None:
    """The reset comes when its answer has left; until then one sample a millisecond was taken."""
    bench = Bench()
    boot_id = bench.value("INFO", "BOOT_ID")
    assert bench.value("LOG", "LAST_BOOT_ID") == bench.value("LOG", "LAST_PRODUCED") == 0, (
        "power has just come"
    )
    bench.run(10)
    bench.value("START")
    bench.run(123)
    produced = SerialDecoder().feed(bench.board.serial_take()).statuses[-1]
    bench.reset()
    assert bench.value("LOG", "LAST_BOOT_ID") == boot_id
    assert 0 < bench.value("LOG", "LAST_PRODUCED") - produced.produced <= 123 + 50


def test_a_main_loop_that_hangs_is_reset_by_the_watchdog() -> None:
    bench = Bench()
    # Nominal 32 kHz: 4000 counts of 1 ms.
    bench.run(3900, np.full(3900, STALLED, np.uint8))
    assert not bench.board.reset_requested
    bench.run(300, np.full(300, STALLED, np.uint8))
    bench.board.soc.thread_held = False
    bench.reboot()
    bench.run(5)
    assert bench.value("INFO", "RESET_CAUSE") == code("reset_cause", "WATCHDOG", "STATUS_HEALTH")


def test_a_sync_edge_flags_the_sample_of_its_own_millisecond() -> None:
    bench = Bench()
    bench.value("START")
    bench.board.serial_take()
    faults = np.zeros(40, np.uint8)
    faults[[7, 23]] = SYNC_EDGE
    bench.run(40, faults)
    bench.run(10)
    (segment,) = SerialDecoder().feed(bench.board.serial_take()).segments
    flagged = np.flatnonzero(segment.samples.flags & 0x10)
    assert np.diff(flagged).tolist() == [16]
    # The bench puts the edge in the middle of the row, which ends 0.98 trigger periods after its tick: half
    # a period after the last one's end is 500 + 122.5 us after that tick, 377.5 us before the sample's own.
    edge_us = bench.value("INFO", "SYNC_US")
    assert int(segment.samples.t_us[flagged[1]]) - edge_us == pytest.approx(377.5, abs=1.5)
    assert bench.value("INFO", "SYNC_COUNT") == 2


def hold_interrupts_until_after_tick(bench: Bench, late_us: float) -> None:
    """From now until `late_us` after the next tick's instant.

    A run ends 0.98 trigger periods after a tick, so the next one is 1000 - 122.5 us away.
    """
    soc = bench.board.soc
    soc.interrupts_held = True

    def release() -> None:
        soc.interrupts_held = False
        soc.interrupts_changed()

    soc.schedule.after_seconds((1000 - 122.5 + late_us) * 1e-6, release)


@pytest.mark.parametrize(
    ("late_us", "late", "missed"),
    [
        (900, 0, 0),  # within the period: nothing is lost, nothing is late
        (1020, 1, 0),  # the half is still whole: late, but delivered
        (1200, 0, 1),  # overwritten since 1125 us
        (3200, 0, 3),
    ],
)
def test_a_delayed_interrupt_loses_no_more_than_it_must(late_us: float, late: int, missed: int) -> None:
    bench = Bench()
    bench.value("START")
    bench.run(100)
    before = bench.status()
    hold_interrupts_until_after_tick(bench, late_us)
    bench.run(20)
    after = bench.status()
    assert after.late - before.late == late
    # The filter's window of 28 conversions has to fill again: three more instants without a sample.
    assert after.overruns - before.overruns == (missed + 3 if missed else 0)
    # Nothing vanishes: every millisecond is a sample or counted.
    assert after.produced - before.produced == round((after.t_us - before.t_us) / 1000)


def test_the_tick_is_far_below_a_quarter_of_its_period() -> None:
    bench = Bench()
    bench.value("START")
    bench.run(200)
    assert 0 < bench.status().worst_tick_us < 250


def test_the_unique_identity_is_that_of_the_chip() -> None:
    bench = Bench()
    identity = struct.pack("<3I", *(bench.value("INFO", f"UID_{i}") for i in range(3)))
    assert identity == struct.pack("<3I", 0x00320044, 0x31385109, 0x38303634)


def test_the_stack_ever_used_is_within_the_computed_worst_case(budget: ModuleType) -> None:
    bench = Bench()
    memory = bench.board.soc.memory
    top = budget.symbols(ELF)["linker_stack_top"]
    # Only main() and its callee are on the stack now; what lies below them is painted.
    paint = b"\xa5" * (top - 0x20000000 - 320)
    memory.write_ram(0x20000000, paint)
    bench.value("START")
    bench.send_on_can("START")
    bench.run(300)
    bench.send_on_can("STOP")
    bench.run(5)
    bench.value("SET", "CAN_KBPS", 500)
    bench.value("SAVE")
    bench.value("STOP")
    bench.value("SELF_TEST")
    bench.run(400)
    stack = memory.read_bytes(0x20000000, top - 0x20000000)
    untouched = len(stack) - len(stack.lstrip(b"\xa5"))
    used = len(stack) - untouched
    computed = sum(need for _, need, _ in budget.stack_rows(ELF))
    assert untouched > 0
    assert 500 < used <= computed, f"{used} bytes used, {computed} computed"


def test_a_damaged_burst_on_the_serial_line_is_counted_once() -> None:
    bench = Bench()
    assert bench.status().line_errors == 0
    bench.board.soc.usart2.damaged_bytes = 3
    bench.board.serial_receive(encode_command(7, code("opcode", "START"), 0, 0), bench.board.now_us + 50)
    bench.run(10)
    after = bench.status()
    assert (after.line_errors, after.rejected) == (1, 1)
    assert bench.value("INFO", "PROTOCOL_VERSION") == 1, "the next burst is whole"
    assert bench.status().line_errors == 1


def test_commands_that_the_can_controller_lost_are_counted() -> None:
    """Its FIFO holds three (RM0390 30.7.4): with the interrupt held off, the fourth and fifth are lost."""
    bench = Bench()
    bench.board.soc.interrupts_held = True
    for _ in range(5):
        bench.send_on_can("STOP")
    bench.run(1)
    bench.board.soc.interrupts_held = False
    bench.board.soc.interrupts_changed()
    status = bench.status()
    assert status.can_overruns == 1, "one flag for both"
    assert status.accepted == 3


def test_a_bus_off_is_counted_once() -> None:
    """Thirty-two transmissions in a row that fail take the controller off the bus (ISO 11898-1)."""
    bench = Bench()
    bench.board.soc.can1.damaged_transmissions = 32
    bench.run(200)  # STATUS at 100 ms has something to transmit
    assert bench.status().bus_off == 1


@pytest.mark.parametrize(("kind", "fault"), [("adc_overruns", 3), ("dma_errors", 4)])
def test_conversions_that_nobody_fetches_are_a_fault_with_a_count_that_outlives_the_reset(
    kind: str, fault: int
) -> None:
    """A stream whose memory address is no memory stops with an error (RM0390 9.3.18); one switched off leaves
    results where they are, and the second is an overrun (13.8.2)."""
    bench = Bench()
    stream = bench.board.soc.dmas["DMA2"].streams[0]
    if kind == "dma_errors":
        stream.value["M0AR"] = 0x30000000
    else:
        stream.value["CR"] &= ~1
    bench.run(3)
    bench.reboot()
    assert bench.value("INFO", "RESET_CAUSE") == code("reset_cause", "FAULT", "STATUS_HEALTH")
    assert bench.value("LOG", "FAULT_KIND") == fault
    counted = {"adc_overruns": 0, "dma_errors": 0} | {kind: 1}
    status = bench.status()
    assert {name: getattr(status, name) for name in counted} == counted
    bench.reset()
    assert getattr(bench.status(), kind) == 1


def test_the_supply_is_followed_while_samples_are_taken() -> None:
    bench = Bench()
    assert bench.status().supply_mV == pytest.approx(3300, abs=2)
    bench.value("START")
    bench.board.supply_mV = 3150
    bench.run(2100)  # eight readings, 128 ms apart, that all belong to the new supply
    status = bench.status()
    # One code of 1574 is 2 mV.
    assert status.supply_mV == pytest.approx(3150, abs=2)
    assert (status.late, status.overruns, status.ring_lost) == (0, 0, 0)
    assert bench.value("INFO", "VREF_MV") == status.supply_mV


def pulls(bench: Bench) -> dict[str, int]:
    """GPIOx_PUPDR of the inputs from outside (RM0390 7.4.4): 0 none, 1 up, 2 down."""
    places = {
        "encoder 1": ["A15", "B3"], "encoder 2": ["A0", "A1"], "faults": ["B10", "A8"], "sync": ["B6"],
    }  # fmt: skip
    gpio = bench.board.soc.gpio
    found = {
        name: {gpio[pin[0]].value["PUPDR"] >> 2 * int(pin[1:]) & 3 for pin in pins}
        for name, pins in places.items()
    }
    assert all(len(values) == 1 for values in found.values()), found
    return {name: values.pop() for name, values in found.items()}


def test_an_input_has_its_pull_only_if_its_setting_says_so() -> None:
    bench = Bench()
    assert pulls(bench) == {"encoder 1": 0, "encoder 2": 0, "faults": 1, "sync": 2}
    for item in ("ENCODER_1_PULL", "ENCODER_2_PULL"):
        bench.value("SET", item, 1)
    for item in ("FAULT_1_PULL", "FAULT_2_PULL", "SYNC_PULL"):
        bench.value("SET", item, 0)
    assert bench.ask("SET", "SYNC_PULL", 2).result == code("result", "BAD_VALUE", "RESPONSE")
    bench.value("SAVE")
    bench.reset()
    assert pulls(bench) == {"encoder 1": 1, "encoder 2": 1, "faults": 0, "sync": 0}
