"""Kill -9 after a few seconds of the same bus: what python-can's own loggers leave behind, and what we do.

The bus is udp_multicast, the frames are a board's at 1 kHz. Counted are the samples that the file still gives
against those that the board had made when the process was killed; the worst of several kills.
"""

import functools
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import can
import numpy as np
from common import RECORD, CanBoard, bus_at, free_multicast, save
from impid_host.errors import InputError
from impid_host.link.can_bus import CanLink
from impid_host.link.client import BoardClient
from impid_host.recording.reader import read_recording

FORMATS = ("asc", "blf", "csv", "db", "log")
ACCEL = 0x110


_LOGGER = """
import sys, can
from impid_host.link.can_bus import parse_address
interface, channel, options = parse_address(sys.argv[1])
bus, log = can.Bus(interface=interface, channel=channel, **options), can.Logger(sys.argv[2])
print("ready", flush=True)
for message in bus:
    log(message)
"""


def python_can(suffix: str, seconds: float, folder: Path) -> dict[str, object]:
    """Its Logger, fed by its Bus, in a process that is killed."""
    address, file = free_multicast(), folder / f"killed.{suffix}"
    board = CanBoard(bus_at(address))
    process = subprocess.Popen([sys.executable, "-c", _LOGGER, address, str(file)], stdout=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.readline()
    with CanLink.open(address) as link:
        client = BoardClient(link)
        client.start()
        first = board.ticks
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            client.pump(0.05)
        ticks = board.ticks
        process.kill()
        process.wait()
        client.stop()
    board.close()
    try:
        with can.LogReader(file) as reader:
            kept = sum(message.arbitration_id == ACCEL for message in reader)
        opened = "yes"
    except Exception as error:  # whatever its readers raise on a torn file is the finding
        kept, opened = 0, f"no ({type(error).__name__})"
    return {"opens": opened, "missing_ms": ticks - first - kept, "of_ms": ticks - first}


def ours(seconds: float, folder: Path) -> dict[str, object]:
    """`impid-host record` on the same bus."""
    address, file = free_multicast(), folder / "killed.mcap"
    board = CanBoard(bus_at(address))
    process = subprocess.Popen(
        [*RECORD, "--can", address, "--out", str(file)], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    while not (file.exists() and file.stat().st_size > 8000):
        time.sleep(0.01)
    time.sleep(seconds)
    ticks = board.ticks
    process.kill()
    process.communicate()
    board.close()
    try:
        s = read_recording(file).segments[0].samples
    except (InputError, IndexError) as error:
        return {"opens": f"no ({error})", "missing_ms": None, "of_ms": None}
    return {"opens": "yes", "missing_ms": ticks - int(s.enc1[-1]), "of_ms": ticks - int(s.enc1[0])}


def main(times: int = 3) -> None:
    rng = np.random.default_rng(3)
    durations = rng.uniform(3.0, 6.0, times)
    makers: dict[str, Callable[[float, Path], dict[str, object]]] = {
        f"python-can .{suffix}": functools.partial(python_can, suffix) for suffix in FORMATS
    }
    makers["impid-host"] = ours
    found = {}
    for name, make in makers.items():
        with tempfile.TemporaryDirectory() as folder:
            runs = [make(float(s), Path(tempfile.mkdtemp(dir=folder))) for s in durations]
        found[name] = max(runs, key=lambda run: (run["opens"] != "yes", run["missing_ms"] or 0))
    save("can_loggers", times=times, loggers=found)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
