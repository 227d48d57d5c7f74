"""Real time with the other core busy: serial at 921600 baud, CAN through an SLCAN adapter, CAN over multicast.

`load.py CARRIER [SECONDS]`. The board runs in a process of its own, as a board does. What its line had no
room for it counts itself. The burning process gives way to nothing but what was started at a higher priority.
"""

import multiprocessing
import os
import subprocess
import sys
import tempfile
from multiprocessing.queues import Queue
from multiprocessing.synchronize import Event
from pathlib import Path

import numpy as np
from common import RECORD, CanBoard, PtyBoard, SlcanBoard, bus_at, free_multicast, save
from impid_host.recording.reader import read_recording

CARRIERS = ("serial", "slcan", "udp_multicast")


def _serve(kind: str, places: "Queue[list[str]]", stop: Event) -> None:
    board: PtyBoard | SlcanBoard | CanBoard
    if kind == "serial":
        board = PtyBoard()
        places.put(["--port", board.port])
    elif kind == "slcan":
        board = SlcanBoard()
        places.put(["--can", f"slcan:{board.port}"])
    else:
        address = free_multicast()
        board = CanBoard(bus_at(address))
        places.put(["--can", address])
    stop.wait()
    board.close()


def _burn(stop: Event) -> None:
    os.nice(max(0, -os.nice(0)))  # as any other program, however this one was started
    while not stop.is_set():
        sum(i * i for i in range(10_000))


def run(kind: str, seconds: float) -> dict[str, object]:
    context = multiprocessing.get_context("spawn")
    stop, places = context.Event(), context.Queue()
    others = [
        context.Process(target=_serve, args=(kind, places, stop), daemon=True),
        context.Process(target=_burn, args=(stop,), daemon=True),
    ]
    for other in others:
        other.start()
    where = places.get(timeout=60)
    try:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "load.mcap"
            command = [*RECORD, *where, "--duration", str(seconds), "--out", str(out)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if not out.exists():
                raise SystemExit(done.stderr)
            recording = read_recording(out)
            megabytes = out.stat().st_size / 1e6
    finally:
        stop.set()
        for other in others:
            other.join(20)
    (ledger,), (segment,) = recording.ledgers, recording.segments
    ticks = segment.samples.enc1.astype(np.uint64)
    return {
        "seconds": seconds,
        "produced": ledger.produced,
        "stored": ledger.stored,
        "lost_before": ledger.lost_before,
        "lost_inside": ledger.lost_inside,
        "lost_after": ledger.lost_after,
        "balanced": ledger.balanced,
        "wrong": int(np.count_nonzero(segment.samples.t_us != ticks * 1000)),
        "dropped_by_the_board": recording.statuses[-1].frames_dropped,
        "damaged": recording.counts.bad_frames,
        "megabytes": round(megabytes, 1),
        "priority": os.nice(0),
        "last_line": done.stdout.strip().partition(": ")[2],
        "trouble": done.stderr.strip(),
    }


def main(kind: str, seconds: float = 600.0) -> None:
    save(f"load_{kind}", **run(kind, seconds))


if __name__ == "__main__":
    main(sys.argv[1], *map(float, sys.argv[2:]))
