"""Real time with the other core busy: serial at 921600 baud, then CAN through an SLCAN adapter.

The board runs in a process of its own, as a board does. What its line had no room for it counts itself.
"""

import multiprocessing
import subprocess
import sys
import tempfile
from pathlib import Path

from common import RECORD, PtyBoard, SlcanBoard, save
from impid_host.recording.reader import read_recording

BOARDS = {"serial": PtyBoard, "can": SlcanBoard}


def _serve(kind: str, ports, stop) -> None:
    board = BOARDS[kind]()
    ports.put(board.port)
    stop.wait()
    board.close()


def _burn(stop) -> None:
    while not stop.is_set():
        sum(i * i for i in range(10_000))


def run(kind: str, seconds: float) -> dict[str, object]:
    context = multiprocessing.get_context("spawn")
    stop, ports = context.Event(), context.Queue()
    others = [
        context.Process(target=_serve, args=(kind, ports, stop), daemon=True),
        context.Process(target=_burn, args=(stop,), daemon=True),
    ]
    for other in others:
        other.start()
    port = ports.get(timeout=60)
    where = ["--port", port] if kind == "serial" else ["--can", f"slcan:{port}"]
    try:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "load.mcap"
            command = [*RECORD, *where, "--duration", str(seconds), "--out", str(out)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            recording = read_recording(out)
            megabytes = out.stat().st_size / 1e6
    finally:
        stop.set()
        for other in others:
            other.join(20)
    (ledger,) = recording.ledgers
    return {
        "seconds": seconds,
        "produced": ledger.produced,
        "stored": ledger.stored,
        "lost": ledger.lost,
        "balanced": ledger.balanced,
        "dropped_by_the_board": recording.statuses[-1].frames_dropped,
        "damaged": recording.counts.bad_frames,
        "megabytes": round(megabytes, 1),
        "last_line": done.stdout.strip().partition(": ")[2],
    }


def main(seconds: float = 600.0) -> None:
    save("load", serial=run("serial", seconds), can=run("can", seconds))


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
