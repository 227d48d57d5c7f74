"""`impid-host record` as a program of its own, against the firmware core on a pseudo-terminal."""

import os
import pty
import re
import resource
import signal
import subprocess
import sys
import time
import tty
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.link.client import BoardClient
from impid_host.link.port import SerialLink
from impid_host.recording.reader import read_recording
from impid_host.wire.messages import choices

from tests.host.recording.boards import PtyBoard

PROGRAM = [sys.executable, "-c", "from impid_host.cli import main; main()", "record"]


def start(*arguments: object) -> subprocess.Popen[str]:
    command = [*PROGRAM, *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def await_growth(path: Path, size: int) -> None:
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline and (not path.exists() or path.stat().st_size < size):
        time.sleep(0.01)
    assert path.stat().st_size >= size


def test_a_recording_holds_every_sample_the_board_produced(board, out: Path) -> None:
    done = start("--port", board.port, "--duration", "2", "--out", out)
    said, complained = done.communicate(timeout=60)
    assert done.returncode == 0, complained
    recording = read_recording(out)
    (segment,), (ledger,) = recording.segments, recording.ledgers
    assert recording.warnings == ()
    assert ledger.balanced
    assert ledger.lost == 0
    assert ledger.stored == len(segment) == 2000
    assert recording.duration_s == pytest.approx(2.0)
    assert f"{ledger.stored} samples stored, 0 lost" in said
    s = segment.samples
    # The board counts ticks on encoder 1, and tick k is at k ms.
    assert np.array_equal(s.t_us, s.enc1.astype(np.uint64) * 1000)
    assert np.array_equal(s.enc2, -s.enc1)
    assert np.array_equal(np.diff(segment.index), np.ones(len(segment) - 1))
    assert 15 <= len(recording.exchanges[77]) <= 30
    assert recording.metadata["impid.board"]["group_delay_us"] == "2006"
    assert [e.name for e in recording.events] == ["start", "run", "enough", "stop"]


def test_nothing_is_imported_while_it_records(board: PtyBoard, tmp_path: Path) -> None:
    """An import takes seconds on a busy machine, and holds up everything that arrives meanwhile."""
    program = (
        "import sys\n"
        "from impid_host.recording.recorder import Recorder\n"
        "from impid_host.cli import main\n"
        "run = Recorder.run\n"
        "def watched(self, *args, **options):\n"
        "    before = set(sys.modules)\n"
        "    outcome = run(self, *args, **options)\n"
        "    print('NEW', sorted(set(sys.modules) - before), file=sys.stderr)\n"
        "    return outcome\n"
        "Recorder.run = watched\n"
        "main()\n"
    )
    asked = ["record", "--port", board.port, "--out", str(tmp_path / "x.mcap"), "--duration", "2"]
    done = subprocess.run(
        [sys.executable, "-c", program, *asked], capture_output=True, text=True, check=False
    )
    assert "clock ±" in done.stdout, done.stderr
    assert "NEW []" in done.stderr


def test_the_duration_is_board_time(fast_board, out: Path) -> None:
    began = time.monotonic()
    done = start("--port", fast_board.port, "--duration", "60", "--out", out)
    _, complained = done.communicate(timeout=60)
    assert done.returncode == 0, complained
    assert time.monotonic() - began < 45  # 6 s, and what a busy machine adds
    (ledger,) = read_recording(out).ledgers
    assert ledger.balanced
    assert ledger.stored + ledger.lost + ledger.surplus >= 60_000
    assert ledger.stored <= 60_000


def test_what_the_line_loses_is_counted_exactly(board, out: Path) -> None:
    """One write in nine of the board is damaged on its way."""
    turn = [0]

    def damage(data: bytes) -> bytes:
        turn[0] += bool(data)
        if data and turn[0] > 40 and turn[0] % 9 == 0:
            return data[: len(data) // 2] + data[len(data) // 2 + 3 :]
        return data

    board.mangle = damage
    done = start("--port", board.port, "--duration", "2", "--out", out)
    said, complained = done.communicate(timeout=60)
    assert done.returncode == 0, complained
    recording = read_recording(out)
    (ledger,) = recording.ledgers
    assert ledger.lost > 50
    assert ledger.balanced
    assert recording.counts.bad_frames > 5
    assert f"{ledger.lost} lost" in said
    s = recording.segments[0].samples
    assert np.array_equal(s.t_us, s.enc1.astype(np.uint64) * 1000)


@pytest.mark.parametrize("moment_s", [0.09, 0.26, 0.43])
def test_killed_it_loses_at_most_a_tenth_of_a_second(board, out: Path, moment_s: float) -> None:
    done = start("--port", board.port, "--duration", "60", "--out", out)
    await_growth(out, 30_000)
    time.sleep(moment_s)  # the file grows with a flush: any moment but that one
    ticks = board.ticks
    done.kill()
    done.communicate(timeout=10)
    recording = read_recording(out)
    assert "was cut off" in recording.warnings[0]
    last_tick = int(recording.segments[0].samples.enc1[-1])
    # 100 ms of recording, and up to 22 samples in the board and on the line.
    assert ticks - last_tick <= 100 + 22


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_it_finishes_in_good_order(board, out: Path, number: signal.Signals) -> None:
    done = start("--port", board.port, "--out", out)
    await_growth(out, 20_000)
    done.send_signal(number)
    said, complained = done.communicate(timeout=20)
    assert done.returncode == 0, complained
    recording = read_recording(out)
    assert recording.warnings == ()
    assert recording.ledgers[0].balanced
    assert recording.metadata["impid.summary"]["ending"] == "complete"
    assert "samples stored, 0 lost" in said


def test_interrupted_before_the_duration_is_not_a_success(board, out: Path) -> None:
    done = start("--port", board.port, "--duration", "60", "--out", out)
    await_growth(out, 20_000)
    done.send_signal(signal.SIGINT)
    _, complained = done.communicate(timeout=20)
    assert done.returncode == 1
    assert "interrupted before the 60 s" in complained


def test_a_full_disk_ends_it_with_what_was_recorded(board, out: Path) -> None:
    """The limit on the size of a file stands for the disk."""
    command = [*PROGRAM, "--port", board.port, "--duration", "60", "--out", str(out)]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=40,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000)),
    )
    assert done.returncode == 1
    assert "cannot be written on (File too large)" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    recording = read_recording(out)
    stored = len(recording.segments[0])
    assert stored > 200
    assert "0 of its" in recording.warnings[0]
    # Samples that came after the disk was full count as lost; the board's own count is there if a status was.
    told = re.search(r"(\d+) samples stored, (\d+) lost", done.stdout)
    assert told is not None, done.stdout
    assert int(told[1]) == stored
    assert int(told[2]) <= 120  # a flush period and what the line holds
    if produced := re.search(r"(\d+) samples produced by the board", done.stdout):
        assert int(produced[1]) == stored + int(told[2])
    with SerialLink.open(board.port) as link:
        assert BoardClient(link).status().state == choices("STATUS_HEALTH", "state")["IDLE"]


def test_the_cable_is_pulled_for_good(board, out: Path) -> None:
    """Somebody else may get the number of a terminal that has gone: it is never opened again."""
    done = start("--port", board.port, "--duration", "60", "--out", out)
    await_growth(out, 20_000)
    board.close()
    said, complained = done.communicate(timeout=20)
    assert done.returncode == 1
    assert "the port is gone" in complained
    assert f"kept in {out}" in complained
    recording = read_recording(out)
    assert recording.warnings == ()
    assert recording.events[-1].name == "disconnected"
    assert f"{len(recording.segments[0])} samples stored" in said


@pytest.fixture
def silent_port():
    master, slave = pty.openpty()
    tty.setraw(slave)
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_wrong_input_is_one_clear_line(tmp_path: Path, silent_port: str) -> None:
    (tmp_path / "there.mcap").write_bytes(b"x")
    cases = [
        (["--port", "/dev/no-such", "--out", tmp_path / "a.mcap"], "no such port"),
        (
            ["--port", silent_port, "--out", tmp_path / "a.mcap"],
            "no answer from a board at any of the speeds 921600",
        ),
        (["--port", silent_port, "--out", tmp_path / "there.mcap"], "exists already"),
        (["--port", silent_port, "--out", tmp_path / "no" / "a.mcap"], "mkdir -p"),
    ]
    for arguments, words in cases:
        done = start(*arguments)
        said, complained = done.communicate(timeout=30)
        assert done.returncode == 1
        assert said == ""
        assert words in complained
        assert len(complained.strip().splitlines()) == 1
        assert not (tmp_path / "a.mcap").exists()
    assert (tmp_path / "there.mcap").read_bytes() == b"x"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--out", "a.mcap"], "either --port, --can or --sim"),
        (["--port", "x", "--sim", "y", "--out", "a.mcap"], "either --port, --can or --sim"),
        (["--port", "x", "--speed", "2", "--out", "a.mcap"], "for --sim only"),
        (["--port", "x", "--duration", "-1", "--out", "a.mcap"], "-1"),
        (["--port", "x"], "--out"),
        (["--port", "x", "--truth", "t.json", "--out", "a.mcap"], "for --sim only"),
    ],
)
def test_wrong_usage(arguments: list[str], words: str) -> None:
    result = CliRunner().invoke(cli, ["record", *arguments])
    assert result.exit_code == 2
    assert words in result.output


@pytest.mark.parametrize("name", ["record", "export"])
def test_help_has_an_example(name: str) -> None:
    result = CliRunner().invoke(cli, [name, "--help"])
    assert result.exit_code == 0
    assert f"impid-host {name} " in result.output.split("Examples:")[1]


def test_cable_out_and_in_by_the_command(tmp_path: Path, out: Path) -> None:
    board = PtyBoard(link=tmp_path / "ttyACM0")
    done = start("--port", board.port, "--duration", "3", "--out", out)
    await_growth(out, 20_000)
    board.unplug()
    time.sleep(0.5)
    board.plug()
    said, complained = done.communicate(timeout=40)
    board.close()
    assert done.returncode == 0, complained
    (ledger,) = read_recording(out).ledgers
    assert ledger.balanced
    assert ledger.lost > 300
    assert f"{ledger.lost} lost" in said


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_ended_while_the_board_is_away(tmp_path: Path, out: Path, number: signal.Signals) -> None:
    board = PtyBoard(link=tmp_path / "ttyACM0")
    done = start("--port", board.port, "--out", out)
    await_growth(out, 20_000)
    board.unplug()
    time.sleep(0.5)
    done.send_signal(number)
    said, _ = done.communicate(timeout=20)
    board.close()
    recording = read_recording(out)
    assert recording.warnings == ()
    names = [event.name for event in recording.events if event.name != "loss"]
    assert names == ["start", "run", "disconnected"]
    assert f"{len(recording.segments[0])} samples stored" in said
