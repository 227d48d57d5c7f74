"""Kill -9 at random moments: how much is missing at the end of the file, in ms of the board's clock.

What is missing was in one of three places: on the board (a batch of ten, two ticks of the filter), in the
port, where it can be read after the kill, or with the recorder. Only the last is the file's loss.

`kill.py [TIMES [stalled]]`. Stalled: the recorder is held up for half a second first, as a busy machine does, and killed
within 40 ms of its going on, while it catches up: the worst moment there is.
"""

import os
import signal
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
STALL_S = 0.5
CATCHING_UP_S = 0.04
PERCENTILES = {"median": 50, "p95": 95, "worst": 100}


def run(out: Path, size: int, wait_s: float, *, stalled: bool = False) -> dict[str, int] | None:
    """Missing samples at the kill: all, and those that the recorder had taken from the port; None where no sample
    had come, or the recorder gave up before (a machine so busy that the board does not answer in time)."""
    board = PtyBoard()
    recorder = subprocess.Popen(
        [*RECORD, "--port", board.port, "--out", str(out)], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        await_size(out, size)
    except TimeoutError as error:
        recorder.kill()
        print(error, recorder.communicate()[1].decode(), file=sys.stderr)
        board.close()
        return None
    if stalled:
        recorder.send_signal(signal.SIGSTOP)
        time.sleep(STALL_S)
        recorder.send_signal(signal.SIGCONT)
    time.sleep(wait_s)
    ticks = board.ticks
    recorder.kill()
    recorder.communicate()
    rest = board.halt()
    board.unplug()
    segments = read_recording(out).segments
    if not segments:
        return None
    (segment,) = segments
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


def main(times: int = 200, how: str = "") -> None:
    stalled = how == "stalled"
    longest_wait_s = CATCHING_UP_S if stalled else 0.15
    rng = np.random.default_rng(1)
    found: list[dict[str, int]] = []
    begun = 0
    with tempfile.TemporaryDirectory() as folder:
        while len(found) < times:
            begun += 1
            out = Path(folder) / f"{begun}.mcap"
            size, wait_s = int(rng.uniform(6e3, 30e3)), float(rng.uniform(0, longest_wait_s))
            result = run(out, size, wait_s, stalled=stalled)
            found += [result] if result is not None else []
            out.unlink(missing_ok=True)
    missing = np.array([each["missing"] for each in found])
    taken = np.array([each["taken"] for each in found])
    save(
        "kill_stalled" if stalled else "kill",
        times=times,
        opened=len(found),
        without_samples=begun - times,
        missing_ms={name: float(np.percentile(missing, at)) for name, at in PERCENTILES.items()},
        taken_ms={name: float(np.percentile(taken, at)) for name, at in PERCENTILES.items()},
        over_100_ms=int((missing > 100).sum()),
        taken_over_100_ms=int((taken > 100).sum()),
        priority=os.nice(0),
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 200, *sys.argv[2:3])
