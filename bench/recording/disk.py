"""The disk fills up at random moments: the file opens, and ends with the last whole flush."""

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from common import RECORD, PtyBoard, save
from impid_host.recording.reader import read_recording


def main(times: int = 50) -> None:
    rng = np.random.default_rng(2)
    opened = torn = wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(times):
            board, out, size = PtyBoard(), Path(folder) / f"{number}.mcap", int(rng.uniform(8e3, 60e3))
            done = subprocess.run(
                [*RECORD, "--port", board.port, "--duration", "30", "--out", str(out)],
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
                preexec_fn=lambda size=size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
            )
            board.close()
            recording = read_recording(out)
            opened += 1
            torn += "0 of its" not in recording.warnings[0]
            s = [segment.samples for segment in recording.segments]
            wrong += any(not np.array_equal(x.t_us, x.enc1.astype(np.uint64) * 1000) for x in s)
            wrong += done.returncode != 1 or len(done.stderr.strip().splitlines()) != 1
            out.unlink()
    save("disk", times=times, opened=opened, torn=torn, wrong=wrong)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
