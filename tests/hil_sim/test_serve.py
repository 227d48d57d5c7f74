"""The served board as a client meets it: a port, frames, a robot's log that is complete when it says so."""

import json
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import serial

from hil_sim.board import layout
from hil_sim.board.wire import FrameReader, command, samples
from hil_sim.scenarios.load import load
from hil_sim.study.write import write_study

SPEED = 5.0
SERVE = [sys.executable, "-c", "from hil_sim.cli import main; main()", "serve"]


@contextmanager
def served(*arguments):
    """A running `impid-sim serve`, and its first line."""
    process = subprocess.Popen(
        [*SERVE, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        yield process, json.loads(process.stdout.readline())
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        process.communicate(timeout=20)


def said(process, event):
    """The next line of that event; a busy machine has others to say in between."""
    while (line := json.loads(process.stdout.readline()))["event"] != event:
        pass
    return line


def read_frames(port, seconds, until=lambda frames: False):
    reader, frames, end = FrameReader(), list[Any](), time.monotonic() + seconds
    while time.monotonic() < end and not until(frames):
        frames += reader.feed(port.read(max(1, port.in_waiting)))
    return frames, reader


def sample_count(frames):
    return sum(frame.count for frame in frames if frame.kind == layout.code("BATCH", "kind", "SAMPLES"))


def kinds(frames):
    return {frame.kind for frame in frames}


def test_a_trial_is_served_whole_and_its_log_is_that_of_the_study(scenario_file, tmp_path):
    """Served or written in virtual time, the robot's log is the same to the byte."""
    scenario = scenario_file(3.0)
    log, truth, setup, link = (tmp_path / name for name in ("log.csv", "truth.json", "setup.toml", "tty"))
    arguments = [scenario, "--trial", "spring_K1_M1_01", "--speed", SPEED, "--seed", 9, "--robot-log", log]
    with served(*arguments, "--truth", truth, "--setup", setup, "--link", link) as (process, ready):
        assert ready["event"] == "ready"
        assert str(link.readlink()) == ready["port"]
        with serial.Serial(str(link), 921600, timeout=0.05) as port:
            port.write(command(1, "START"))
            frames, reader = read_frames(port, 60.0, lambda got: sample_count(got) > 3300)
            finished = said(process, "trial-finished")
            written = log.read_bytes()
            port.write(command(2, "PING"))
            late, _ = read_frames(port, 5.0, lambda got: layout.code("BATCH", "kind", "PONG") in kinds(got))
        assert process.wait(timeout=10) == 0
    assert finished["event"] == "trial-finished"
    assert finished["robot_log_rows"] == 3000
    assert not link.exists()
    assert layout.code("BATCH", "kind", "PONG") in kinds(late)
    assert reader.damaged == 0
    got = samples(frames)
    assert got.seq.size > 3300
    assert np.all(np.diff(got.seq.astype(np.int64)) == 1)
    assert layout.code("BATCH", "kind", "STATUS") in kinds(frames)

    write_study(load(str(scenario)), tmp_path / "study", 9)
    assert written == (tmp_path / "study/spring_K1_M1_01/robot.csv").read_bytes()
    assert setup.read_bytes() == (tmp_path / "study/setup.toml").read_bytes()

    # The clocks' truth of this very run: both count the same encoders.
    clock = json.loads(truth.read_text())["trials"]["spring_K1_M1_01"]["clock"]
    t = clock["robot_s_at_board_zero"] + (1.0 + 1e-6 * clock["drift_ppm"]) * 1e-6 * got.t_us
    rows = np.loadtxt(log, delimiter=",", skiprows=1)
    inside = (t > rows[0, 0]) & (t < rows[-1, 0])
    angle = got.enc1[inside] * 2 * np.pi / 400_000
    assert np.abs(angle - np.interp(t[inside], rows[:, 0], rows[:, 1])).max() < 30e-6


def test_the_robot_rests_until_start_and_sigterm_leaves_a_whole_log(scenario_file, tmp_path):
    log = tmp_path / "log.csv"
    with served(scenario_file(30.0), "--trial", "free_01", "--robot-log", log) as (process, ready):
        with serial.Serial(ready["port"], 921600, timeout=0.05) as port:
            before, _ = read_frames(port, 20.0, lambda got: len(got) >= 3)
            assert log.read_text().count("\n") == 1
            assert kinds(before) == {layout.code("BATCH", "kind", "STATUS")}
            port.write(command(1, "START"))
            read_frames(port, 60.0, lambda _: log.read_text().count("\n") > 300)
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=10) == 0
        stopped = said(process, "stopped")
    text = log.read_text()
    assert stopped["event"] == "stopped"
    assert stopped["robot_log_rows"] > 100
    assert text.endswith("\n")
    assert text.count("\n") == stopped["robot_log_rows"] + 1
    assert {line.count(",") for line in text.splitlines()} == {6}


def test_a_log_that_cannot_be_written_is_one_line(scenario_file):
    result = subprocess.run(
        [*SERVE, str(scenario_file()), "--trial", "free_01", "--robot-log", "/nowhere/log.csv"],
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )
    assert result.returncode == 1
    assert (
        result.stderr
        == "impid-sim: /nowhere/log.csv: No such file or directory; name a place that can be written to\n"
    )


def test_an_existing_file_is_not_replaced_by_the_link(scenario_file, tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("mine")
    result = subprocess.run(
        [*SERVE, str(scenario_file()), "--trial", "free_01", "--link", str(taken)],
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )
    assert result.returncode == 1
    assert "is no link" in result.stderr
    assert Path(taken).read_text() == "mine"


@pytest.mark.parametrize("trial", ["free_01"])
def test_ping_is_stamped_with_the_board_time_of_its_arrival(scenario_file, trial):
    """One clock map must put every t2 between the sending of its PING and the arrival of its answer."""
    with (
        served(scenario_file(30.0), "--trial", trial) as (_process, ready),
        serial.Serial(ready["port"], 921600, timeout=0.05) as port,
    ):
        stamps = []
        pong = layout.code("BATCH", "kind", "PONG")
        for request in range(1, 9):
            sent = time.monotonic()
            port.write(command(request, "PING"))
            frames, _ = read_frames(port, 5.0, lambda got: pong in kinds(got))
            answer = next(frame for frame in frames if frame.kind == pong)
            fields = layout.unpack("PONG", np.frombuffer(answer.records, np.uint8).reshape(1, 8))
            stamps.append((time.monotonic() - sent, 1e-6 * float(fields["t2_us"][0]) - sent))
            time.sleep(0.1)
    # board - machine lies between t2 - arrival and t2 - sending in every exchange; 21 ppm of 2 s are 42 us.
    lowest = max(offset - took for took, offset in stamps)
    highest = min(offset for _, offset in stamps)
    assert lowest < highest + 50e-6


def test_the_robot_sends_its_rows_as_they_come(tmp_path: Path) -> None:
    """By UDP, the rows that robot.csv has in the end, while the robot moves."""
    log = tmp_path / "robot.csv"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
        port.bind(("127.0.0.1", 0))
        port.settimeout(20)
        port.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        where = "{}:{}".format(*port.getsockname())
        arguments = ("first-light", "--trial", "free_01", "--robot-log", log, "--torques-to", where)
        with served(*arguments) as (process, ready), serial.Serial(ready["port"], timeout=0.1) as board:
            board.write(command(1, "START"))
            lines: list[str] = []
            while len(lines) < 500:
                lines += port.recv(65536).decode().splitlines()
            assert process.poll() is None
    sent = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    written = np.loadtxt(log, delimiter=",", skiprows=1)
    assert sent == pytest.approx(written[: len(sent), :5], abs=1e-8)


def test_a_place_that_no_rows_can_go_to() -> None:
    done = subprocess.run(
        [*SERVE, "first-light", "--torques-to", "nowhere"], capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert "give HOST:PORT, as in 127.0.0.1:9870" in done.stderr
