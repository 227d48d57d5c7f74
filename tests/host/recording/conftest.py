"""A board on a pseudo-terminal: the firmware core that ships, with made-up readings, at any pace."""

import os
import pty
import select
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from hil_sim.board.native import BoardConfig, NativeBoard


class PtyBoard:
    """Runs until closed. Encoder 1 counts ticks, encoder 2 counts backwards; both axes stay at mid-scale.

    `mangle` may change or drop what the board sends before it reaches the line.
    """

    def __init__(self, speed: float = 1.0, config: BoardConfig | None = None) -> None:
        self.mangle: Callable[[bytes], bytes] = lambda data: data
        self.ticks = 0
        self._speed = speed
        self._board = NativeBoard(config or BoardConfig(boot_id=77))
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        self._slave = slave
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Pull the cable: the port is gone for whoever has it open."""
        if not self._closing.is_set():
            self._closing.set()
            self._thread.join()
            os.close(self._slave)
            os.close(self._master)

    def _serve(self) -> None:
        start_s, start_us = time.monotonic(), self._board.now_us
        while not self._closing.is_set():
            now_us = start_us + int((time.monotonic() - start_s) * self._speed * 1e6)
            while self._board.next_tick_us <= now_us:
                self._tick()
            sent = self.mangle(self._board.serial_take())
            while sent and not self._closing.is_set():
                if select.select([], [self._master], [], 0.1)[1]:
                    sent = sent[os.write(self._master, sent[:1024]) :]
            if select.select([self._master], [], [], 0.0005)[0]:
                asked_us = start_us + int((time.monotonic() - start_s) * self._speed * 1e6)
                self._board.serial_receive(os.read(self._master, 4096), asked_us)

    def _tick(self) -> None:
        adc = np.full((1, 8, 2), 2048, dtype=np.uint16)
        self._board.run(adc, np.array([[self.ticks, -self.ticks]], dtype=np.int32))
        self.ticks += 1


@pytest.fixture
def board() -> Iterator[PtyBoard]:
    """A board in real time."""
    board = PtyBoard()
    yield board
    board.close()


@pytest.fixture
def fast_board() -> Iterator[PtyBoard]:
    """A board at ten times real time, on a line that is as much faster."""
    board = PtyBoard(speed=10.0)
    yield board
    board.close()


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """Where to record."""
    return tmp_path / "free_01.mcap"
