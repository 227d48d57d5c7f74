"""The served board against the wall clock: it catches up, gives up what is hopeless, and says both."""

import signal
import subprocess
import time

import numpy as np
import pytest
import serial

from hil_sim.serve.lag import LagMeter
from hil_sim.serve.pace import Pace

from .serving import SERVE, Client, serving


def test_lag_is_booked_and_bounded():
    lag = LagMeter()
    assert lag.observe(-0.002, 0.004) == 0.0
    assert lag.observe(0.05, 0.01) == 0.0
    assert lag.observe(0.5, 0.25) == 0.0
    assert lag.observe(1.9, 0.5) == 0.0
    assert lag.report() == {"worst_s": 1.9, "behind_s": 0.75, "slipped_s": 0.0}
    assert lag.observe(7.0, 7.0) == 7.0
    assert lag.report() == {"worst_s": 7.0, "behind_s": 7.75, "slipped_s": 7.0}


def test_complaints_come_at_most_every_five_seconds():
    lag = LagMeter()
    moments = [now for now in range(20) if lag.complaint_is_due(0.2 if now != 10 else 0.01, float(now))]
    assert moments == [0, 5, 11, 16]


def test_a_shifted_pace_goes_on_at_its_rate():
    pace = Pace(1_000_000, 2.0, 1.0)
    before, begin = pace.now_us(), time.monotonic()
    pace.shift(-5_000_000)
    time.sleep(0.05)
    gone = pace.now_us() - before + 5_000_000
    assert gone == pytest.approx(2e6 * (time.monotonic() - begin), abs=2000)
    assert pace.seconds_until(pace.now_us() + 100_000) == pytest.approx(0.05, abs=1e-3)


def suspend(process, seconds):
    process.send_signal(signal.SIGSTOP)
    time.sleep(seconds)
    process.send_signal(signal.SIGCONT)


def test_a_machine_that_stood_still_is_said_and_no_sample_is_lost(scenario_file):
    """Half a second is caught up with; three are not, and the board's clock stands still for them."""
    with serving(scenario_file(60.0), "--trial", "free_01") as board:
        with serial.Serial(board.ready["port"], 921600, timeout=0.05) as port:
            client = Client(port)
            assert client.ask("START")
            client.read(0.3)
            suspend(board.process, 0.6)
            short = board.event("lag")
            client.read(5.5)
            suspend(board.process, 3.0)
            long = board.event("lag")
            client.read(0.5)
        closed = board.end()
        complaints = board.process.stderr.read().splitlines()
    assert 0.4 < short["now_s"] < 1.5
    assert short["slipped_s"] == 0.0
    assert long["slipped_s"] > 2.5
    assert closed["lag"]["worst_s"] >= long["slipped_s"] > short["now_s"]
    assert len([line for line in complaints if "behind" in line]) >= 2
    got = client.samples
    assert np.all(np.diff(got.seq.astype(np.int64)) == 1)
    assert np.all(np.diff(got.t_us) == 1000)


def test_it_ends_with_who_started_it(scenario_file):
    """A recorder that is killed cannot say goodbye; its end of the pipe closes all the same."""
    process = subprocess.Popen(
        [*SERVE, str(scenario_file(60.0)), "--until-stdin-closes"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert '"ready"' in process.stdout.readline()
    time.sleep(0.3)
    assert process.poll() is None
    process.stdin.close()
    assert process.wait(timeout=20) == 0
    assert '"closed"' in process.stdout.read().splitlines()[-1]


def test_by_hand_it_needs_no_input(scenario_file):
    """Started in the background of a shell it has no standard input, and goes on."""
    process = subprocess.Popen(
        [*SERVE, str(scenario_file(60.0))], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True
    )
    assert '"ready"' in process.stdout.readline()
    time.sleep(0.5)
    assert process.poll() is None
    process.terminate()
    assert process.wait(timeout=20) == 0
