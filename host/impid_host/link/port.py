"""A serial port or `socket://` address, read by a thread that does nothing else.

The thread stamps every piece when it arrives and queues it. Whatever the rest of the program is busy with (a
disk that takes a second to sync), the operating system's small buffer is emptied in time and the stamps stay
honest.
"""

import contextlib
import errno
import os
import select
from typing import Self

import serial
from serial.tools import list_ports

from impid_host.errors import LinkError
from impid_host.link.inbox import PILED_UP_BYTES, POLL_S, Inbox
from impid_host.link.link import Chunk
from impid_host.wire.carrier import SERIAL
from impid_host.wire.messages import SERIAL_BAUD


class SerialLink:
    """An open port. Chunks wait in order until `receive` takes them; close it when done."""

    carrier = SERIAL

    def __init__(self, port: serial.Serial, name: str) -> None:
        self.name = name
        self._port = port
        self._inbox = Inbox(
            name, self._read_on, f"{name}: the port is gone; check the cable and the board's power"
        )

    @classmethod
    def open(cls, url: str, baud: int = SERIAL_BAUD) -> Self:
        """Open a device path or a pyserial URL such as socket://host:port.

        Raises:
            LinkError: there is no such port, it is in use, or the user may not open it.
        """
        try:
            port = serial.serial_for_url(url, baudrate=baud, timeout=POLL_S, do_not_open=True)
            if "://" not in url:
                port.exclusive = True
            port.open()
        except (OSError, ValueError) as error:
            raise LinkError(_why(url, error)) from error
        with contextlib.suppress(AttributeError, NotImplementedError, OSError, ValueError):
            port.set_low_latency_mode(True)  # USB adapters hold bytes back for 16 ms otherwise
        return cls(port, url)

    def set_baud(self, baud: int) -> None:
        """Change the speed of the line; without effect where there is no line (sockets, terminals).

        Raises:
            LinkError: the port does not know that speed, or is gone.
        """
        try:
            self._port.baudrate = baud
        except (OSError, ValueError) as error:
            raise LinkError(f"{self.name}: the port does not take {baud} baud ({error})") from error

    def send(self, data: bytes) -> Chunk:
        """Write everything; the stamp is taken just before.

        Raises:
            LinkError: the port is gone.
        """
        chunk = Chunk.now(data)
        try:
            self._port.write(data)
        except OSError as error:
            raise LinkError(f"{self.name}: the port is gone ({error}); check the cable") from error
        return chunk

    def receive(self, timeout_s: float) -> Chunk | None:
        """The next chunk, or None when nothing came in time.

        Raises:
            LinkError: the port is gone and every chunk that came before has been taken.
        """
        return self._inbox.take(timeout_s)

    def close(self) -> None:
        """Stop reading and release the port; a port that is gone already is no error."""
        self._inbox.stop()
        with contextlib.suppress(OSError):
            self._port.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _read_on(self, inbox: Inbox) -> None:
        read = (
            self._read_descriptor if os.name == "posix" and hasattr(self._port, "fileno") else self._read_port
        )
        with contextlib.suppress(OSError, TypeError, ValueError):  # all three: a port closed while it is read
            while not inbox.closing.is_set():
                data = read()
                if data is None:
                    break
                if data:
                    inbox.put(Chunk.now(data))

    def _read_descriptor(self) -> bytes | None:
        """What has come; b"" after a quiet while, None at the end (pyserial reads sockets byte by byte)."""
        descriptor = self._port.fileno()
        ready, _, _ = select.select([descriptor], [], [], POLL_S)
        return (os.read(descriptor, PILED_UP_BYTES) or None) if ready else b""

    def _read_port(self) -> bytes | None:
        return bytes(self._port.read(1)) + bytes(self._port.read(self._port.in_waiting))


def _why(url: str, error: Exception) -> str:
    code = error.errno if isinstance(error, OSError) else None
    if code == errno.ENOENT:
        present = ", ".join(sorted(p.device for p in list_ports.comports())) or "none"
        return f"{url}: no such port; ports on this machine: {present}"
    if code in (errno.EACCES, errno.EPERM):
        return (
            f"{url}: permission denied; join the group that owns it (sudo usermod -aG dialout $USER) "
            "and log in again"
        )
    if code in (errno.EBUSY, errno.EAGAIN):
        return f"{url}: in use by another program; close it first"
    if "://" in url:
        return f"{url}: {error}; check the address and that something listens there"
    return f"{url}: cannot be opened as a serial port ({error}); name a serial device or a socket://host:port"
