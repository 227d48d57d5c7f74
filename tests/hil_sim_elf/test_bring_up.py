"""The bench test against a board whose every number is known: the emulated chip, its wire and its operator."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from impid_host.bring_up import clocks, converter, recovery, wire
from impid_host.bring_up.board import BenchBoard
from impid_host.bring_up.result import Result
from impid_host.bring_up.run import bring_up
from impid_host.cli.device import command
from impid_host.link.address import Address
from impid_host.link.client import BoardClient
from impid_host.link.link import Link

from hil_sim.board.elf.board import ElfBoard
from hil_sim.board.elf.flash import Cut
from hil_sim.board.elf.wire import Wire
from tests.hil_sim_elf.chip_link import ChipLink, Codes

PINS = {"encoder 1 A": ("A", 15), "encoder 2 A": ("A", 0), "x": ("C", 0), "y": ("C", 1)}
SELF_TEST_CODES = 280  # 225 mV of 3300 in 12 bits
AXIS_NOISE, REFERENCE_NOISE, PPM = 3.5, 0.8, 37.0


class Bench:
    """A board, a wire, and hands."""

    def __init__(self, image: Path, **link: float) -> None:
        self.random = np.random.default_rng(11)
        board = ElfBoard(image)
        board.reference_noise = lambda: float(self.random.normal(0, REFERENCE_NOISE))
        self.wire_ = Wire(board)
        self.link = ChipLink(board, codes=self.sensor, **link)  # type: ignore[arg-type]
        self.board = BenchBoard(BoardClient(self.link), self.link.now)
        self.wired: list[str] = []

    def sensor(self, ticks: int) -> Codes:
        """An accelerometer at rest, with noise and a self-test."""
        level = 2048 + SELF_TEST_CODES * self.link.board.self_test_pin
        codes = np.rint(self.random.normal(level, AXIS_NOISE, (ticks, 8, 2)))
        return np.clip(codes, 0, 4095).astype(np.uint16)

    def bare(self) -> bool:
        return True

    def wire(self, signal: str) -> bool:
        self.wired.append(signal)
        self.wire_.put(PINS[signal])
        return True

    def unwire(self) -> bool:
        self.wire_.put(None)
        return True

    def unplug(self) -> bool:
        self.link.board.soc.flash.cut = Cut(700, 2)
        return True

    def reopen(self) -> Link:
        self.link.board.soc.flash.cut = None
        self.link.board, self.link.powered = ElfBoard(self.link.board.soc.memory), True
        return self.link


@pytest.fixture
def bench(firmware: Path) -> Bench:
    return Bench(firmware)


def test_every_number_is_that_of_the_board(firmware: Path) -> None:
    bench = Bench(firmware, ppm=PPM)
    results = {r.what: r for r in bring_up(bench.board, bench, bench.reopen, 0.2)}
    wrong = [r for r in results.values() if r.passed is False]
    assert wrong == []
    assert [name for name, r in results.items() if r.value is None] == ["wander of that rate"]
    measured = {name: r.value for name, r in results.items() if r.value is not None}
    for name, truth, error in (
        ("noise of the converter on its reference", np.hypot(REFERENCE_NOISE, 12**-0.5), 0.06),
        ("noise of axis x, converter at 8 kHz", np.hypot(AXIS_NOISE, 12**-0.5), 0.08),
        ("noise of axis y, converter at 8 kHz", np.hypot(AXIS_NOISE, 12**-0.5), 0.08),
        ("clock against the PC's, 0.2 minutes", PPM, 1.0),
        # The emulated converter holds after 15 of its clocks, 4 of 90 MHz each; counts have no delay there.
        ("instant of the counts, encoder 1 A", 0.0, 0.012),
        ("instant of the voltage, x", 60 / 90, 0.012),
        ("latch skew, voltage behind counts", 60 / 90, 0.001),
        # 4000 counts of 32 periods of 32 kHz, from the refresh before the hang to the reset, then the boot.
        ("watchdog: from the hang to the first status of the next boot", 4.15, 0.1),
    ):
        assert measured[name] == pytest.approx(truth, abs=error), name
    assert bench.wired == list(wire.SIGNALS)
    settings = bench.board.client.settings()
    assert settings["encoder_2_cpr"] == 0, "what the test saved is undone"


def test_an_internal_oscillator_that_is_off_shows(bench: Bench) -> None:
    soc = bench.link.board.soc
    soc.hsi_hz = 16e6 * 1.012
    soc.request_reset("pin")
    bench.link.receive(0.01)
    _, result = clocks.external_clock(bench.board)
    assert result.value == pytest.approx(100 * (1 / 1.012 - 1), abs=0.013)
    soc.hsi_hz = 16e6 * 1.06
    soc.request_reset("pin")
    bench.link.receive(0.01)
    assert clocks.external_clock(bench.board)[1].passed is False


def test_without_its_external_clock_the_board_says_so(firmware: Path) -> None:
    link = ChipLink(ElfBoard(firmware, hse_present=False))
    runs, counted = clocks.external_clock(BenchBoard(BoardClient(link), link.now))
    assert runs.passed is False
    assert counted.value is None


def test_without_a_wire_nothing_is_made_up(bench: Bench) -> None:
    bench.wire = lambda signal: True  # type: ignore[method-assign]
    results = wire.latch_instants(bench.board, bench)
    assert {r.verdict for r in results} == {"not measured"}
    assert "is the wire" in results[0].detail


def test_a_line_of_an_encoder_that_is_broken_shows(bench: Bench) -> None:
    gpio = bench.link.board.soc.gpio["B"]
    gpio.drive(3, False)  # line B of encoder 1 lies on ground
    assert wire.quadrature(bench.board, 1).passed is False
    assert wire.quadrature(bench.board, 2).passed is True


def test_no_accelerometer_is_not_measured_and_a_bad_one_is_out_of_bound(bench: Bench) -> None:
    bench.link.codes = lambda ticks: np.full((ticks, 8, 2), 2000, np.uint16)
    assert {r.verdict for r in converter.accelerometer(bench.board)} == {"not measured"}

    def odd(ticks: int) -> Codes:
        """Twice the noise, on x even codes alone, and a self-test of y alone."""
        codes = bench.random.normal(2048, 2 * AXIS_NOISE, (ticks, 8, 2))
        codes[:, :, 1] += SELF_TEST_CODES * bench.link.board.self_test_pin
        codes[:, :, 0] = 2 * np.rint(codes[:, :, 0] / 2)
        return np.rint(codes).astype(np.uint16)

    bench.link.codes = odd
    verdicts = {r.what: r.passed for r in converter.accelerometer(bench.board)}
    assert verdicts == {
        "self-test of the accelerometer": False,
        "noise of axis x, converter at 8 kHz": False,
        "noise of axis y, converter at 8 kHz": False,
        "missing codes of axis x": False,
        "missing codes of axis y": True,
        "noise of axis x at rest, stream": True,
        "noise of axis y at rest, stream": True,
    }


def test_a_converter_with_much_noise_is_out_of_bound(bench: Bench) -> None:
    bench.link.board.reference_noise = lambda: float(bench.random.normal(0, 3.0))
    (result,) = converter.reference_noise(bench.board)
    assert result.passed is False
    assert result.value == pytest.approx(3.0, abs=0.25)


@pytest.mark.parametrize(("operations", "bytes_kept"), [(300, 0), (311, 1), (322, 3), (335, 2)])
def test_power_lost_anywhere_in_a_save_leaves_settings_whole(
    bench: Bench, operations: int, bytes_kept: int
) -> None:
    def unplug() -> bool:
        bench.link.board.soc.flash.cut = Cut(operations, bytes_kept)
        return True

    bench.unplug = unplug  # type: ignore[method-assign]
    assert recovery.unplugged(bench.board, bench, bench.reopen).passed is True


def test_settings_that_do_not_survive_are_out_of_bound(bench: Bench) -> None:
    """Somebody erases both sectors while the power is off."""
    reopen = bench.reopen

    def erased() -> Link:
        bench.link.board.soc.memory.flash[0x8000:0x10000] = b"\xff" * 0x8000
        return reopen()

    assert recovery.unplugged(bench.board, bench, erased).passed is False


def test_a_plug_that_nobody_pulls_is_not_measured(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recovery, "_SAVES", 3)
    bench.unplug = lambda: True  # type: ignore[method-assign]
    assert recovery.unplugged(bench.board, bench, bench.reopen).value is None
    assert bench.board.client.settings()["encoder_2_cpr"] == 0


def test_the_report_is_whole_and_its_status_tells(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The command, with its bench test cut down to two rows."""
    monkeypatch.setattr(Address, "open", lambda _self: bench.link)
    rows: list[Result] = [
        Result("one", 1.0, "us", 0.0, 2.0, "fine", "it"),
        Result("two", None, detail="no wire"),
    ]
    module = "impid_host.cli.device_bring_up.bring_up"
    give: Callable[..., list[Result]] = lambda *_arguments: rows  # noqa: E731
    monkeypatch.setattr(module, give)
    out = tmp_path / "board.md"
    done = CliRunner().invoke(command, ["bring-up", "--port", "chip", "--out", str(out)])
    assert done.exit_code == 0, done.output
    text = out.read_text(encoding="utf-8")
    assert text == done.output
    for part in ("00320044", "| one | 1 us | 0 to 2 | ok | fine |", "| two |  |  | not measured | no wire |",
                 "**1 ok, 0 out of bound, 1 not measured.**", "- one: it."):  # fmt: skip
        assert part in text
    rows.append(Result("three", 3.0, "us", 0.0, 2.0))
    again = CliRunner().invoke(command, ["bring-up", "--port", "chip", "--out", str(out)])
    assert again.exit_code == 1
    assert "exists already" in str(again.exception)
    assert CliRunner().invoke(command, ["bring-up", "--port", "chip"]).exit_code == 1
