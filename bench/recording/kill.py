"""Kill -9 at random moments: how much is missing at the end of the file, in ms of the board's clock.

What is missing was in one of three places: on the board (a batch of ten, two ticks of the filter), in the
port, where it can be read after the kill, or with the recorder. Only the last is the file's loss.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from common import RECORD, PtyBoard, await_size, save
from impid_host.recording.reader import read_recording
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.records import Segment

FILTER_TICKS = 2
BATCH_SAMPLES = 10
PERCENTILES = {"median": 50, "p95": 95, "worst": 100}


def run(out: Path, size: int, wait_s: float) -> dict[str, int]:
    """Missing samples at the kill: all, and those that the recorder had taken from the port."""
    board = PtyBoard()
    recorder = subprocess.Popen(
        [*RECORD, "--port", board.port, "--out", str(out)], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    await_size(out, size)
    time.sleep(wait_s)
    ticks = board.ticks
    recorder.kill()
    recorder.communicate()
    rest = board.halt()
    board.unplug()
    (segment,) = read_recording(out).segments
    last = int(segment.samples.enc1[-1])
    missing = ticks - last  # the board ran on for a moment behind the kill: no more than this was taken
    return {"missing": missing, "taken": min(missing, _taken(rest, segment, board.ticks) - last)}


def _taken(rest: bytes, segment: Segment, ticks: int) -> int:
    """The last tick whose sample the recorder can have taken whole."""
    left = [int(s.samples.enc1[0]) for s in SerialDecoder().feed(rest).segments]
    first_index, first_tick = int(segment.index[0]), int(segment.samples.enc1[0])
    if left:  # frames that nobody took; one that the kill tore counts as taken, to be on the safe side
        return left[0] - 1
    made = ticks - FILTER_TICKS - first_tick + first_index  # index behind the newest sample
    return first_tick - first_index + made // BATCH_SAMPLES * BATCH_SAMPLES - 1


def main(times: int = 200) -> None:
    rng = np.random.default_rng(1)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(times):
            out = Path(folder) / f"{number}.mcap"
            found.append(run(out, int(rng.uniform(6e3, 30e3)), float(rng.uniform(0, 0.15))))
            out.unlink()
    missing = np.array([each["missing"] for each in found])
    taken = np.array([each["taken"] for each in found])
    save(
        "kill",
        times=times,
        opened=len(found),
        missing_ms={name: float(np.percentile(missing, at)) for name, at in PERCENTILES.items()},
        taken_ms={name: float(np.percentile(taken, at)) for name, at in PERCENTILES.items()},
        over_100_ms=int((missing > 100).sum()),
        taken_over_100_ms=int((taken > 100).sum()),
        priority=os.nice(0),
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
