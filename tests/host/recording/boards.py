"""Boards for tests: the firmware core that ships, with made-up readings, on a terminal or on a CAN bus."""

import contextlib
import os
import pty
import queue
import select
import termios
import threading
import time
import tty
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import can
import numpy as np
from impid_host.wire.can_frames import CAN_FRAME
from impid_host.wire.carrier import CAN
from impid_host.wire.messages import OPCODE

from hil_sim.board.native import BoardConfig, NativeBoard

CONFIG = BoardConfig(boot_id=77)


class _Board:
    """Runs until closed. Encoder 1 counts ticks of this boot, encoder 2 backwards; axes at mid-scale."""

    def __init__(self, speed: float, config: BoardConfig | None) -> None:
        self.ticks = 0
        self.produced_before = 0  # by boots that have ended, as their last tick had it
        self._speed = speed
        self._config = config or CONFIG
        self._board = NativeBoard(self._config)
        self._start_s, self._start_us = time.monotonic(), self._board.now_us
        self._reset_asked = threading.Event()
        self._closing = threading.Event()
        self._frames: list[tuple[int, bytes]] = []
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def reset(self) -> None:
        """Push the reset button."""
        self._reset_asked.set()

    def close(self) -> None:
        if not self._closing.is_set():
            self._closing.set()
            self._thread.join()

    @property
    def clock_zero_s(self) -> float:
        """What the PC's monotonic clock showed when this boot's clock was zero."""
        return self._start_s - self._start_us * 1e-6 / self._speed

    def _now_us(self) -> int:
        return self._start_us + int((time.monotonic() - self._start_s) * self._speed * 1e6)

    def _serve(self) -> None:
        while not self._closing.is_set():
            if self._reset_asked.is_set() or self._board.reset_requested:
                self._exchange()
                self._reset_asked.clear()
                self._config = replace(self._config, boot_id=self._config.boot_id + 1, reset_cause=2)
                self.produced_before = self.ticks
                self._board, self.ticks = NativeBoard(self._config), 0
                self._start_s, self._start_us = time.monotonic(), self._board.now_us
            self._catch_up()
            self._exchange()

    def _catch_up(self) -> int:
        """Run every tick that is due; returns the board's time, at which nothing is due any more.

        A command is handed over at that time: to a board that lives in the past its samples would look old.
        In small pieces, so that the line carries away what was sent before more comes.
        """
        now_us = self._now_us()
        while self._board.next_tick_us <= now_us:
            adc = np.full((1, 8, 2), 2048, dtype=np.uint16)
            counts = np.array([[self.ticks, -self.ticks]], dtype=np.int64).astype(np.int32)
            self._board.run(adc, counts)
            self.ticks += 1
            if self.ticks % 20 == 0:
                self._collect()
        self._collect()
        return now_us

    def _collect(self) -> None:
        """Take what the board has sent."""
        self._frames += self._board.can_take()

    def _exchange(self) -> None:
        """Carry it to the host, and bring what the host says."""
        raise NotImplementedError


class PtyBoard(_Board):
    """On a pseudo-terminal. `mangle` may change or drop what the board sends before it reaches the line.

    With a `link`, that name stands for the plugged-in port, as a device file does. With a `baud`, only who
    has set the line to that speed understands anything.
    """

    def __init__(
        self,
        speed: float = 1.0,
        config: BoardConfig | None = None,
        *,
        link: Path | None = None,
        baud: int | None = None,
    ) -> None:
        super().__init__(speed, config)
        self.mangle: Callable[[bytes], bytes] = lambda data: data
        self._link = link
        self._baud = baud
        self._cable = threading.Lock()
        self._bytes = b""
        self._master = self._slave = -1
        self.plug()
        self._thread.start()

    def plug(self) -> None:
        """Put the cable in."""
        with self._cable:
            self._master, self._slave = pty.openpty()
            tty.setraw(self._slave)
            self.port = os.ttyname(self._slave)
            if self._link is not None:
                self._link.symlink_to(self.port)
                self.port = str(self._link)

    def unplug(self) -> None:
        """Pull the cable: the port is gone for whoever has it open; the board runs on."""
        with self._cable:
            if self._master >= 0:
                if self._link is not None:
                    self._link.unlink()
                os.close(self._slave)
                os.close(self._master)
                self._master = -1

    def close(self) -> None:
        super().close()
        self.unplug()

    def halt(self) -> bytes:
        """Stop the board; what it had sent and nobody has taken from a port that nobody reads any more."""
        self._closing.set()
        self._thread.join()
        rest = b""
        while select.select([self._slave], [], [], 0.5)[0]:
            rest += os.read(self._slave, 65536)
        return rest + self._bytes

    def _collect(self) -> None:
        self._bytes += self._board.serial_take()

    def _exchange(self) -> None:
        with self._cable:
            self._collect()
            sent, self._bytes = self.mangle(self._bytes), b""
            if self._master < 0:
                time.sleep(0.0005)
                return
            while sent and not self._closing.is_set():
                if not self._understood():
                    sent = bytes(byte ^ 0x5A for byte in sent)
                if select.select([], [self._master], [], 0.1)[1]:
                    sent = sent[os.write(self._master, sent[:1024]) :]
            self._bytes = sent  # nothing, but where the board was halted amid it
            if select.select([self._master], [], [], 0.0005)[0]:
                asked = os.read(self._master, 4096)
                if self._understood():
                    self._board.serial_receive(asked, self._catch_up())

    def _understood(self) -> bool:
        if self._baud is None:
            return True
        return termios.tcgetattr(self._slave)[4] == getattr(termios, f"B{self._baud}")


class CanBoard(_Board):
    """On a bus of python-can that another process or thread shares."""

    def __init__(self, bus: can.BusABC, speed: float = 1.0, config: BoardConfig | None = None) -> None:
        super().__init__(speed, config)
        self._bus = bus
        self._asked: queue.SimpleQueue[tuple[int, bytes]] = queue.SimpleQueue()
        self.connected = True
        self._thread.start()

    def command(self, opcode: str) -> None:
        """As if somebody on the bus had sent it."""
        frame = np.frombuffer(CAN.encode_command(1, OPCODE[opcode], 0, 0), dtype=CAN_FRAME)[0]
        self._asked.put((int(frame["identifier"]), frame["data"].tobytes()))

    def close(self) -> None:
        super().close()
        self._bus.shutdown()

    def _exchange(self) -> None:
        frames, self._frames = self._frames, []
        for identifier, data in frames:
            if self.connected:
                self._bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
        with contextlib.suppress(queue.Empty):
            self._board.can_receive(*self._asked.get_nowait(), self._catch_up())
        message = self._bus.recv(0.0005)
        if message is not None and self.connected:
            self._board.can_receive(message.arbitration_id, bytes(message.data), self._catch_up())


class SlcanBoard(_Board):
    """Behind a USB adapter that speaks the Lawicel protocol on a pseudo-terminal."""

    def __init__(self, speed: float = 1.0, config: BoardConfig | None = None) -> None:
        super().__init__(speed, config)
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._asked = b""
        self._open = False
        self._thread.start()

    def close(self) -> None:
        super().close()
        os.close(self._slave)
        os.close(self._master)

    def _exchange(self) -> None:
        lines = b"".join(b"t%03X%d%s\r" % (i, len(d), d.hex().upper().encode()) for i, d in self._frames)
        self._frames = []
        while lines and self._open and not self._closing.is_set():
            if select.select([], [self._master], [], 0.1)[1]:
                lines = lines[os.write(self._master, lines[:1024]) :]
        if not select.select([self._master], [], [], 0.0005)[0]:
            return
        *commands, self._asked = (self._asked + os.read(self._master, 4096)).split(b"\r")
        for command in commands:
            if command[:1] == b"t":
                data = bytes.fromhex(command[5:].decode())
                self._board.can_receive(int(command[1:4], 16), data, self._catch_up())
                os.write(self._master, b"z\r")
            elif command:
                self._open = command[:1] == b"O" or (self._open and command[:1] != b"C")
                os.write(self._master, b"\r")
