"""A running `impid-sim serve`, its lines, and a client that reads its frames."""

import json
import queue
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from typing import Any

from hil_sim.board import layout
from hil_sim.board.wire import FrameReader, command, samples

SERVE = [sys.executable, "-c", "from hil_sim.cli import main; main()", "serve"]


class Served:
    """The process, what it announced, and every line it has said since."""

    def __init__(self, process):
        self.process = process
        self._lines: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.events = []
        threading.Thread(target=self._read, daemon=True).start()
        self.ready = self.event("ready")

    def event(self, name, timeout=60.0, **fields):
        """The next line of that event and with these fields; those that come before it stay in `events`."""
        end = time.monotonic() + timeout
        while True:
            said = self._lines.get(timeout=max(0.0, end - time.monotonic()))
            assert said is not None, f"ended without {name} {fields}; said {self.events}"
            self.events.append(said)
            if said["event"] == name and all(said[key] == value for key, value in fields.items()):
                return said

    def end(self):
        """SIGTERM; its last line."""
        self.process.send_signal(signal.SIGTERM)
        closed = self.event("closed", timeout=20)
        assert self.process.wait(timeout=20) == 0
        return closed

    def _read(self):
        for line in self.process.stdout:
            self._lines.put(json.loads(line))
        self._lines.put(None)


@contextmanager
def serving(*arguments):
    """Starts it, and kills it if the test left it running."""
    process = subprocess.Popen(
        [*SERVE, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        yield Served(process)
    finally:
        if process.poll() is None:
            process.kill()
        process.wait(timeout=20)
        process.stderr.close()


class Client:
    """Reads one serial port into frames; sends commands with new identifiers."""

    def __init__(self, port):
        self.port = port
        self.reader = FrameReader()
        self.frames = []
        self._request = 100

    def ask(self, opcode, tries=4):
        """Sends until answered; returns nothing when that never happens."""
        self._request += 1
        kind = layout.code("BATCH", "kind", "RESPONSE")
        for _ in range(tries):
            answers = sum(frame.kind == kind for frame in self.frames)
            self.port.write(command(self._request, opcode))
            if self.read(1.0, lambda seen=answers: sum(f.kind == kind for f in self.frames) > seen):
                return True
        return False

    def read(self, seconds, until=lambda: False):
        """Reads until `until` holds; whether it did."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and not until():
            self.frames += self.reader.feed(self.port.read(max(1, self.port.in_waiting)))
        return until()

    def read_to_board_time(self, board_us, seconds=60.0):
        """Reads until a frame of that board time has come."""
        assert self.read(seconds, lambda: bool(self.frames) and self.frames[-1].t0_us >= board_us)

    @property
    def samples(self):
        """All samples so far."""
        return samples(self.frames)
