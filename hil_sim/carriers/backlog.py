"""Bytes that wait for a client which does not read as fast as the board sends."""

from collections.abc import Callable

# A client that falls this far behind loses bytes, as it would behind a real adapter.
CAPACITY_BYTES = 1 << 20


class Backlog:
    """A queue of bounded length in front of a descriptor that does not block."""

    def __init__(self, write: Callable[[bytearray], int]) -> None:
        """`write` takes what it can, returns how much, and raises OSError when it can take nothing."""
        self._write = write
        self._waiting = bytearray()
        self.dropped = 0

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, data: bytes) -> None:
        """Queues what there is room for and writes what is taken at once."""
        room = CAPACITY_BYTES - len(self._waiting)
        self.dropped += max(0, len(data) - room)
        self._waiting += data[:room]
        self.flush()

    def flush(self) -> None:
        """Writes as much as is taken."""
        while self._waiting:
            try:
                written = self._write(self._waiting)
            except OSError:  # full, or nobody there: later
                return
            del self._waiting[:written]

    def clear(self) -> None:
        """Forgets what waits: the client it waited for has gone."""
        self._waiting.clear()
