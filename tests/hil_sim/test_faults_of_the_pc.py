"""The PC's own faults: its clock jumps, its disk is full. Only the program under test sees them."""

import subprocess
import sys
import time

import pytest

from hil_sim.faults.full_disk import full_after

WATCH = """
import time
wall, steady = time.time() - time.monotonic(), time.monotonic()
end = time.monotonic() + 1.5
while time.monotonic() < end:
    jumped = time.time() - time.monotonic() - wall
    if abs(jumped) > 1.0:
        print(jumped, time.time_ns() / 1e9 - time.time(), time.monotonic() - steady)
        break
"""


@pytest.mark.parametrize("jump_s", [3600.0, -90.5])
def test_the_wall_clock_jumps_at_its_moment_and_the_monotonic_one_does_not(tmp_path, jump_s):
    script = tmp_path / "watch.py"
    script.write_text(WATCH)
    before = time.time() - time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "hil_sim.faults.pc_clock", "--", str(jump_s), "0.5", str(script)],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    jumped, apart, after_s = map(float, done.stdout.split())
    assert jumped == pytest.approx(jump_s, abs=0.01)
    assert abs(apart) < 0.01
    assert 0.2 < after_s < 0.6
    assert abs(time.time() - time.monotonic() - before) < 0.5  # the machine's own clock is as it was


def test_a_program_that_is_not_there_is_one_line():
    done = subprocess.run(
        [sys.executable, "-m", "hil_sim.faults.pc_clock", "1", "1", "no-such-program"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr == "impid-sim: no-such-program: no such program; name a Python script\n"


def test_a_full_disk_takes_exactly_its_bytes(tmp_path):
    path = tmp_path / "file"
    program = f"""
import errno
with open({str(path)!r}, "wb", buffering=0) as file:
    try:
        for _ in range(100):
            file.write(bytes(1000))
    except OSError as error:
        print(errno.errorcode[error.errno])
"""
    done = subprocess.run(
        full_after(12_345, [sys.executable, "-c", program]),
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert done.stdout == "EFBIG\n"
    assert path.stat().st_size == 12_345
