"""A recording's size and how long it takes to open; the recorder's share of a core."""

import multiprocessing
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import can
import day_file
import load
from impid_host.recording.reader import read_recording

from speed.wire import CAN_TICKS, frames, write_blf

_MOST_S = 60.0


def opened(carrier: str, hours: float) -> Iterator[list[float]]:
    """Open a recording of so many hours; yields its size and that of the raw bytes, MB."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "one.mcap"
        day_file.write(carrier, hours, path)
        yield [path.stat().st_size / 1e6]
        read_recording(path)


def opened_blf() -> Iterator[list[float]]:
    """The file of python-can's logger, 200 s of the same frames, read by its own reader; yields its size, MB."""
    raw, _ = frames()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.blf"
        write_blf(raw, path)
        yield [path.stat().st_size / 1e6, CAN_TICKS / 3.6e6]
        with can.LogReader(path) as reader:
            for _message in reader:
                pass


def share(kind: str, seconds: float) -> float:
    """Of a core, that `impid-host record` takes at 1 kHz; the board is another process."""
    context = multiprocessing.get_context("spawn")
    stop, places = context.Event(), context.Queue()
    board = context.Process(target=load._serve, args=(kind, places, stop), daemon=True)
    board.start()
    where = places.get(timeout=_MOST_S)
    try:
        with tempfile.TemporaryDirectory() as folder:
            spent = [_recorded([*where, "--duration", str(n)], Path(folder)) for n in (1.0, 1.0 + seconds)]
    finally:
        stop.set()
        board.join(20)
    return (spent[1] - spent[0]) / seconds


def _recorded(how: list[str], folder: Path) -> float:
    """Processor time of one recording, start and all."""
    out = folder / f"{time.monotonic_ns()}.mcap"
    code = (
        "import atexit, sys, time\natexit.register(lambda: print('spent', time.process_time(), file=sys.stderr))\n"
        "from impid_host.cli import main\nmain()"
    )
    command = [sys.executable, "-c", code, "record", *how, "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return float(done.stderr.rpartition("spent ")[2].split()[0])
