"""The disk fills up at random moments: the file opens, ends with the last whole flush, and says what it lacks.

Every recording is given a file size beyond which the system refuses to write. What had arrived by then and is
not in the file is the recorder's own count; it is held against the board's, which is told to stop at once.
"""

import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from common import RECORD, PtyBoard, save
from impid_host.recording.reader import read_recording

MISSING = re.compile(r"(\d+) samples that had arrived are missing")


def main(times: int = 200) -> None:
    rng = np.random.default_rng(2)
    torn = wrong = unclear = 0
    missing = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(times):
            board, out, size = PtyBoard(), Path(folder) / f"{number}.mcap", int(rng.uniform(8e3, 60e3))
            done = subprocess.run(
                [*RECORD, "--port", board.port, "--duration", "30", "--out", str(out)],
                capture_output=True,
                text=True,
                timeout=120,
                check=False,
                preexec_fn=lambda size=size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
            )
            board.close()
            recording = read_recording(out)
            torn += "0 of its" not in recording.warnings[0]
            s = [segment.samples for segment in recording.segments]
            wrong += any(not np.array_equal(x.t_us, x.enc1.astype(np.uint64) * 1000) for x in s)
            said = MISSING.search(done.stderr)
            lines = done.stderr.strip().splitlines()
            unclear += done.returncode != 1 or said is None or not lines[-1].startswith("impid-host: ")
            missing.append(int(said[1]) if said else -1)
            out.unlink()
    save(
        "disk",
        times=times,
        opened=len(missing),
        torn=torn,
        wrong=wrong,
        unclear=unclear,
        missing_ms={"median": float(np.median(missing)), "worst": max(missing)},
        over_100_ms=sum(m > 100 for m in missing),
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
