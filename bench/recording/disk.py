"""The disk fills up at random moments: the file opens, ends with the last whole flush, and says what it lacks.

The recorder's library in this process, under a file size beyond which the system refuses to write. What had
arrived by then and is not in the file is the recorder's count at the failed write against the file read back.
"""

import resource
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np
from common import PtyBoard, save
from impid_host.errors import InputError
from impid_host.link.client import BoardClient
from impid_host.link.port import SerialLink
from impid_host.recording.reader import read_recording
from impid_host.recording.recorder import Recorder
from impid_host.recording.writer import RecordingWriter


def run(out: Path, size: int) -> dict[str, int | bool]:
    """Record until the limit is hit."""
    board = PtyBoard()
    hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        with SerialLink.open(board.port) as link:
            writer = RecordingWriter.create(out, {})
            outcome = Recorder(BoardClient(link), writer).run(30.0)
            with suppress(InputError):
                writer.close({"ending": outcome.ending})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
        board.close()
    recording = read_recording(out)
    s = [segment.samples for segment in recording.segments]
    return {
        "missing": outcome.progress.counts.stored - sum(map(len, s)),
        "torn": "0 of its" not in recording.warnings[0],
        "wrong": any(not np.array_equal(x.t_us, x.enc1.astype(np.uint64) * 1000) for x in s),
        "unclear": outcome.ending != "disk-full" or "free some space" not in outcome.trouble,
    }


def main(times: int = 200) -> None:
    rng = np.random.default_rng(2)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(times):
            out = Path(folder) / f"{number}.mcap"
            found.append(run(out, int(rng.uniform(8e3, 60e3))))
            out.unlink()
    missing = [each["missing"] for each in found]
    save(
        "disk",
        times=times,
        opened=len(found),
        **{name: sum(bool(each[name]) for each in found) for name in ("torn", "wrong", "unclear")},
        missing_ms={"median": float(np.median(missing)), "worst": max(missing)},
        over_100_ms=sum(m > 100 for m in missing),
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
