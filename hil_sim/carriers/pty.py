"""A pseudo-terminal: to the client it is a serial port like any other."""

import contextlib
import errno
import os
import select
import time
from pathlib import Path

from hil_sim.carriers.backlog import Backlog
from hil_sim.errors import SimError

READ_BYTES = 65536
IDLE_S = 2e-3


class PtyCarrier:
    """Implements `Carrier` on the master side of a pseudo-terminal in raw mode."""

    available = hasattr(os, "openpty")

    def __init__(self, link: Path | None = None) -> None:
        """Opens a terminal.

        Args:
            link: also make a symbolic link of this name to it. It goes with the cable and comes back with it.

        Raises:
            SimError: something that is no link has that name, or this system has no terminals (Windows).
        """
        if not self.available:
            raise SimError("this system has no pseudo-terminals; use --carrier tcp")
        if link is not None and link.exists() and not link.is_symlink():
            raise SimError(f"{link}: exists and is no link; name another place for --link")
        self._link = link
        self._backlog = Backlog(lambda data: os.write(self._master, data))
        self._master = -1
        self._address = ""
        self._connected = False
        self.plug()

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
        return self._backlog.dropped

    def pull(self) -> None:
        """The terminal is gone, as with an adapter that is unplugged."""
        if self._link is not None and self._link.is_symlink():
            self._link.unlink()
        if self._master >= 0:
            with contextlib.suppress(OSError):
                os.close(self._master)
        self._master = -1
        self._connected = False
        self._backlog.clear()

    def plug(self) -> None:
        """A terminal is there, perhaps under another number, as with an adapter that is plugged in."""
        import tty  # noqa: PLC0415  (not on Windows)

        self._master, slave = os.openpty()
        self._address = os.ttyname(slave)
        tty.setraw(slave)
        # With the other end closed again, the kernel tells us when a client opens and closes it.
        os.close(slave)
        os.set_blocking(self._master, False)
        if self._link is not None:
            if self._link.is_symlink():
                self._link.unlink()
            self._link.symlink_to(self._address)

    def close(self) -> None:
        """Takes terminal and link away."""
        self.pull()

    def receive(self, timeout_s: float) -> bytes:
        """Waits until bytes come, at most timeout_s, and returns them."""
        if self._master < 0:
            time.sleep(timeout_s)
            return b""
        self._backlog.flush()
        writers = [self._master] if self._backlog else []
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
            self._backlog.clear()
            time.sleep(min(timeout_s, IDLE_S))
            return b""
        self._connected = True
        return data

    def send(self, data: bytes) -> None:
        """Queues bytes for the client and writes what it takes at once."""
        if self._connected:
            self._backlog.put(data)
