"""Cables pulled, boards reset, clocks set: the recording goes on and time is never spliced."""

import contextlib
import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from impid_host.link.address import Address
from impid_host.link.client import BoardClient
from impid_host.recording.reader import Recording, read_recording
from impid_host.recording.recorder import Outcome, Recorder
from impid_host.recording.writer import RecordingWriter
from impid_host.wire.records import Response

from hil_sim.board.native import BoardConfig
from tests.host.recording.boards import PtyBoard


class Session:
    """A recording in this thread; `at` runs things once that many seconds of board time are stored."""

    def __init__(self, address: Address, out: Path, patience_s: float = 10.0) -> None:
        self.address, self.out, self.patience_s = address, out, patience_s
        self._due: list[tuple[float, Callable[[], object]]] = []

    def at(self, elapsed_s: float, action) -> "Session":
        self._due.append((elapsed_s, action))
        return self

    def run(
        self, duration_s: float, at_the_end: Callable[[], None] = lambda: None
    ) -> tuple[Outcome, Recording]:
        with contextlib.ExitStack() as stack:
            link = self.address.open()
            client = stack.enter_context(contextlib.closing(BoardClient(link)))

            def report(progress) -> None:
                while self._due and progress.elapsed_s >= self._due[0][0]:
                    self._due.pop(0)[1]()

            writer = RecordingWriter.create(self.out, {}, carrier=link.carrier.name)
            recorder = Recorder(client, writer, open_link=self.address.open, patience_s=self.patience_s)
            recorder.identify()
            stop = client.stop
            asked: list[None] = []

            def stopping() -> Response:
                asked.append(None)
                if len(asked) == 2:  # the first makes sure that nothing streams
                    at_the_end()
                return stop()

            client.stop = stopping  # type: ignore[method-assign]
            outcome = recorder.run(duration_s, report=report)
            writer.close({"ending": outcome.ending})
        return outcome, read_recording(self.out)


def one_boot_is_one_clock(recording: Recording) -> None:
    """Tick k of a boot is at k ms and reads k on encoder 1: a spliced or invented time would show."""
    for segment in recording.segments:
        s = segment.samples
        assert np.array_equal(s.t_us, s.enc1.astype(np.uint64) * 1000)
        assert np.array_equal(np.diff(segment.index), np.diff(s.enc1))


def names(recording: Recording) -> list[str]:
    return [event.name for event in recording.events if event.name != "loss"]


@pytest.fixture
def plugged(tmp_path: Path):
    board = PtyBoard(link=tmp_path / "ttyACM0")
    yield board
    board.close()


def test_cable_out_and_in(plugged: PtyBoard, out: Path) -> None:
    """The board runs on: what it sent into the void is lost, and counted to the sample."""
    back = []

    def pull() -> None:
        plugged.unplug()
        time.sleep(0.7)
        plugged.plug()
        back.append(time.monotonic_ns())

    outcome, recording = Session(Address(port=plugged.port), out).at(0.8, pull).run(3.0)
    assert outcome.ending == "complete"
    assert names(recording) == ["start", "run", "disconnected", "reconnected", "enough", "stop"]
    (ledger,) = recording.ledgers
    assert ledger.balanced
    assert 600 < ledger.lost < 1700
    one_boot_is_one_clock(recording)
    (again,) = [event for event in recording.events if event.name == "reconnected"]
    assert again.monotonic_ns - back[0] < 1e9


def test_a_reset_in_mid_stream_opens_a_run_of_its_own(plugged: PtyBoard, out: Path) -> None:
    outcome, recording = Session(Address(port=plugged.port), out).at(1.0, plugged.reset).run(3.0)
    assert outcome.ending == "complete"
    assert [segment.boot_id for segment in recording.segments] == [77, 78]
    # The answer to START and the first samples may come in one piece.
    assert [name for name in names(recording) if name != "run"] == [
        "start",
        "boot",
        "start",
        "enough",
        "stop",
    ]
    boot = next(event for event in recording.events if event.name == "boot")
    assert (boot.detail["before"], boot.detail["boot_id"], boot.detail["reset_cause"]) == (77, 78, 2)
    one_boot_is_one_clock(recording)
    assert [ledger.balanced for ledger in recording.ledgers] == [True, True]
    # A sample is complete two ticks after its instant; the board had told nobody of its last ones.
    assert (
        recording.ledgers[0].produced == plugged.produced_before - 2 - recording.segments[0].samples.enc1[0]
    )
    assert recording.ledgers[1].lost_before == 0
    # Its clock begins at its boot: the first sample of the new run says how long the gap was.
    assert int(recording.segments[1].samples.t_us[0]) < 1_000_000
    assert set(recording.exchanges) == {77, 78}


def test_cable_out_and_a_reset_meanwhile(plugged: PtyBoard, out: Path) -> None:
    def power_cycle() -> None:
        plugged.unplug()
        plugged.reset()
        time.sleep(0.3)
        plugged.plug()

    outcome, recording = Session(Address(port=plugged.port), out).at(1.0, power_cycle).run(2.5)
    assert outcome.ending == "complete"
    assert [segment.boot_id for segment in recording.segments] == [77, 78]
    assert "boot" in names(recording)
    one_boot_is_one_clock(recording)


def test_a_board_that_stays_away(plugged: PtyBoard, out: Path) -> None:
    began = []

    def pull() -> None:
        plugged.unplug()
        began.append(time.monotonic())

    outcome, recording = Session(Address(port=plugged.port), out, patience_s=1.0).at(0.5, pull).run(60.0)
    assert outcome.ending == "disconnected"
    assert "the port is gone" in outcome.trouble
    assert 0.9 < time.monotonic() - began[0] < 4
    assert recording.warnings == ()
    assert recording.events[-1].name == "disconnected"


def test_a_board_that_is_gone_when_it_is_to_stop(plugged: PtyBoard, out: Path) -> None:
    """The last samples and the board's own count are waited for like any others."""
    until = [0.0]

    def hang() -> None:
        until[0] = time.monotonic() + 3.0
        plugged.mangle = lambda data: b"" if time.monotonic() < until[0] else data

    outcome, recording = Session(Address(port=plugged.port), out).run(1.2, at_the_end=hang)
    assert outcome.ending == "complete"
    (ledger,) = recording.ledgers
    assert ledger.balanced
    assert ledger.lost is not None
    assert ledger.lost == ledger.lost_after
    assert ledger.lost > 0
    assert "disconnected" in names(recording)


def test_silence_is_noticed_and_survived(plugged: PtyBoard, out: Path) -> None:
    """The port stays, nothing comes: as with a hub that hangs."""
    until = [0.0]

    def hang() -> None:
        until[0] = time.monotonic() + 1.6
        plugged.mangle = lambda data: b"" if time.monotonic() < until[0] else data

    outcome, recording = Session(Address(port=plugged.port), out).at(0.5, hang).run(3.5)
    assert outcome.ending == "complete"
    assert names(recording) == ["start", "run", "disconnected", "reconnected", "enough", "stop"]
    assert "nothing heard" in json.dumps([event.detail for event in recording.events])
    (ledger,) = recording.ledgers
    assert ledger.balanced
    assert ledger.lost > 1000
    again = next(event for event in recording.events if event.name == "reconnected")
    assert again.monotonic_ns * 1e-9 - until[0] < 1.0


def test_another_board_is_not_taken_for_the_one_that_went(tmp_path: Path, out: Path) -> None:
    first = PtyBoard(link=tmp_path / "tty")
    others = []

    def swap() -> None:
        first.unplug()
        others.append(PtyBoard(link=tmp_path / "tty", config=BoardConfig(uid=(1, 2, 3), boot_id=5)))

    outcome, recording = (
        Session(Address(port=str(tmp_path / "tty")), out, patience_s=1.0).at(0.5, swap).run(60)
    )
    first.close()
    others[0].close()
    assert outcome.ending == "disconnected"
    assert [segment.boot_id for segment in recording.segments] == [77]


@pytest.mark.parametrize("by_s", [3600.0, -3600.0])
def test_the_clock_of_the_pc_is_set(plugged: PtyBoard, out: Path, monkeypatch, by_s: float) -> None:
    real = time.time_ns

    def jump() -> None:
        monkeypatch.setattr("impid_host.link.link.time.time_ns", lambda: real() + int(by_s * 1e9))

    outcome, recording = Session(Address(port=plugged.port), out).at(0.5, jump).run(1.5)
    assert outcome.ending == "complete"
    (jumped,) = [event for event in recording.events if event.name == "wall-clock-set"]
    assert jumped.detail["by_s"] == pytest.approx(by_s, abs=0.01)
    (ledger,) = recording.ledgers
    assert ledger.balanced
    assert ledger.lost < 100  # none, unless the machine is too busy for the board of the test
    one_boot_is_one_clock(recording)
    exchanges = recording.exchanges[77]
    assert np.all(np.diff([each.t1_ns for each in exchanges]) > 0)


@pytest.mark.parametrize("baud", [921600, 460800, 115200])
def test_the_speed_of_the_line_is_found(tmp_path: Path, baud: int) -> None:
    board = PtyBoard(baud=baud)
    address = Address(port=board.port)
    link = address.open()
    assert BoardClient(link).info().boot_id == 77
    assert address.baud == baud
    link.close()
    board.close()
