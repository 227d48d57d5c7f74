"""What an SLCAN adapter says, line by line: only lines that can be what it meant are passed on.

The adapter's protocol has no checksum, and python-can takes a line that is too long for its length digit: one
byte twice, and every digit behind it would be read at the wrong place. Bits that flip inside a digit stay
unseen; on USB the bus itself guards against them.
"""

import re
from collections.abc import Callable
from typing import Any

_ID_DIGITS = {b"t": 3, b"r": 3, b"T": 8, b"R": 8}
_LONGEST = 64  # no line is longer: noise without an end must not pile up
_FRAME = re.compile(rb"(?:[tr][0-9A-Fa-f]{3}|[TR][0-9A-Fa-f]{8})([0-8])([0-9A-Fa-f]*)\r")


def well_formed(line: bytes) -> bool:
    """Whether a line, its end included, is a whole frame, or no frame at all (an answer of the adapter)."""
    if line[:1] not in _ID_DIGITS:
        return True
    frame = _FRAME.fullmatch(line)
    if frame is None:
        return False
    return len(frame[2]) == (0 if line[:1] in b"rR" else 2 * int(frame[1]))


class CheckedLines:
    """A serial port for python-can's slcan, which asks for every byte by a call of its own."""

    def __init__(self, port: Any) -> None:
        self._port = port
        self._part = b""
        self._waiting = b""

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read at once."""
        return len(self._waiting) or int(self._port.in_waiting)

    def read(self, size: int = 1) -> bytes:
        """At most `size` bytes of whole lines; b"" where none has come."""
        if not self._waiting:
            *lines, self._part = re.split(
                rb"(?<=[\r\a])", self._part + self._port.read(max(1, self._port.in_waiting))
            )
            self._waiting = b"".join(line for line in lines if well_formed(line))
            self._part = self._part[-_LONGEST:]
        taken, self._waiting = self._waiting[:size], self._waiting[size:]
        return taken

    def __getattr__(self, name: str) -> Callable[..., Any]:
        return getattr(self._port, name)  # type: ignore[no-any-return]
