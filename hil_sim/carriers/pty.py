"""A pseudo-terminal: to the client it is a serial port like any other."""

import contextlib
import errno
import os
import select
import time
import tty

READ_BYTES = 65536
# A client that falls this far behind loses bytes, as it would behind a real adapter.
QUEUE_BYTES = 1 << 20
IDLE_S = 2e-3


class PtyCarrier:
    """Implements `Carrier` on the master side of a pseudo-terminal in raw mode."""

    def __init__(self) -> None:
        self._master, slave = os.openpty()
        self._address = os.ttyname(slave)
        tty.setraw(slave)
        # With the other end closed again, the kernel tells us when a client opens and closes it.
        os.close(slave)
        os.set_blocking(self._master, False)
        self._connected = False
        self._queue = bytearray()
        self._dropped = 0

    @property
    def address(self) -> str:
        """The device file that a client opens."""
        return self._address

    @property
    def connected(self) -> bool:
        """A client has the terminal open."""
        return self._connected

    @property
    def dropped(self) -> int:
        """Bytes lost because the client did not read."""
        return self._dropped

    def receive(self, timeout_s: float) -> bytes:
        """Waits until bytes come, at most timeout_s, and returns them."""
        self._flush()
        writers = [self._master] if self._queue else []
        readable, _, _ = select.select([self._master], writers, [], timeout_s)
        if not readable:
            self._connected = True
            return b""
        try:
            data = os.read(self._master, READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            self._connected = False
            self._queue.clear()
            time.sleep(min(timeout_s, IDLE_S))
            return b""
        self._connected = True
        return data

    def send(self, data: bytes) -> None:
        """Queues bytes for the client and writes what it takes at once."""
        if not self._connected:
            return
        room = QUEUE_BYTES - len(self._queue)
        self._dropped += max(0, len(data) - room)
        self._queue += data[:room]
        self._flush()

    def close(self) -> None:
        """Takes the terminal away."""
        with contextlib.suppress(OSError):
            os.close(self._master)

    def _flush(self) -> None:
        while self._queue:
            try:
                written = os.write(self._master, self._queue)
            except OSError:  # full, or nobody there: later
                return
            del self._queue[:written]
