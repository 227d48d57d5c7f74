"""Kill -9 at random moments: how much is missing at the end of the file, in ms of the board's clock."""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from common import RECORD, PtyBoard, await_size, save
from impid_host.recording.reader import read_recording

# What the board still held (a batch, and two ticks of the filter) was never in the recorder's hands.
IN_BOARD_MS = 22


def main(times: int = 200) -> None:
    rng = np.random.default_rng(1)
    missing = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(times):
            board = PtyBoard()
            out = Path(folder) / f"{number}.mcap"
            recorder = subprocess.Popen(
                [*RECORD, "--port", board.port, "--out", str(out)],
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
            await_size(out, int(rng.uniform(8e3, 40e3)))
            time.sleep(rng.uniform(0, 0.15))
            ticks = board.ticks
            recorder.kill()
            recorder.communicate()
            board.close()
            segments = read_recording(out).segments
            missing.append(ticks - int(segments[0].samples.enc1[-1]))
            out.unlink()
    save(
        "kill",
        times=times,
        opened=len(missing),
        median_ms=float(np.median(missing)),
        p95_ms=float(np.percentile(missing, 95)),
        worst_ms=int(max(missing)),
        in_board_ms=IN_BOARD_MS,
        over_the_promise=sum(m > 100 + IN_BOARD_MS for m in missing),
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
