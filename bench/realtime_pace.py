"""How well `impid-sim serve` keeps pace with real time: lag of the board, and of what a client receives.

Usage: python bench/realtime_pace.py [SECONDS] [CARRIER]
"""

import json
import subprocess
import sys
import time

import numpy as np
import serial

from hil_sim.board import layout
from hil_sim.board.wire import FrameReader, command, samples

SERVE = [sys.executable, "-c", "from hil_sim.cli import main; main()", "serve", "first-light"]


def main() -> None:
    """Streams for so long, with a ping ten times a second as a recorder sends them, and prints the lags."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 120.0
    carrier = sys.argv[2] if len(sys.argv) > 2 else "pty"
    process = subprocess.Popen(
        [*SERVE, "--carrier", carrier], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    ready = json.loads(process.stdout.readline())
    reader, frames = FrameReader(), []
    arrivals = []  # when a batch came, seconds, and when its last sample was due, board time
    kind = layout.code("BATCH", "kind", "SAMPLES")
    with serial.serial_for_url(ready["port"], 921600, timeout=0.01) as port:
        port.write(command(1, "START"))
        begin = time.monotonic()
        pings = 0
        while (now := time.monotonic() - begin) < seconds:
            if now > 0.1 * pings:
                pings += 1
                port.write(command(1 + pings, "PING"))
            for frame in reader.feed(port.read(max(1, port.in_waiting))):
                if frame.kind == kind:
                    frames.append(frame)
                    due_us = frame.t0_us + 1000 * frame.count
                    arrivals.append((time.monotonic() - begin, 1e-6 * due_us))
        process.terminate()
    said = [json.loads(line) for line in process.communicate(timeout=30)[0].splitlines()]
    seq = samples(frames).seq.astype(np.int64)
    arrived, due = np.array(arrivals).T
    # The board's clock is fitted, so that what remains is the wait of a batch beyond the quickest one.
    late = arrived - np.polyval(np.polyfit(due, arrived, 1), due)
    late -= late.min()
    rate = (arrived[-1] - arrived[0]) / (due[-1] - due[0]) - 1.0
    print(f"{carrier}, {seconds:g} s: {seq.size} samples, {np.count_nonzero(np.diff(seq) != 1)} gaps")
    print(
        f"  batch later than the quickest: median {1e3 * np.median(late):.1f} ms, "
        f"99.9 % {1e3 * np.quantile(late, 0.999):.1f} ms, worst {1e3 * late.max():.1f} ms"
    )
    print(f"  wall against board: {1e6 * rate:+.0f} ppm (true: +21)")
    print(
        f"  by its own book: {said[-1]['lag']}; {sum(event['event'] == 'lag' for event in said)} complaints"
    )


if __name__ == "__main__":
    main()
