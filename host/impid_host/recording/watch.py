"""What a recording keeps an eye on: whether the board still streams, whether somebody sets the PC's clock."""

import time

from impid_host.link.client import Identity
from impid_host.link.link import Chunk
from impid_host.wire.messages import choices
from impid_host.wire.records import BoardStatus

_IDLE = choices("STATUS_HEALTH", "state")["IDLE"]
# A status may have been on its way when START was answered.
_SETTLE_S = 0.2
# Time servers slew; a step of more than this between two pieces is somebody setting the clock.
_JUMP_S = 0.02


class BoardWatch:
    """Knows from its statuses when a board that should stream does not."""

    def __init__(self) -> None:
        self.identity: Identity | None = None
        self.must_be_started = False
        self._started_s = time.monotonic()

    def started(self) -> None:
        """START has just been answered."""
        self._started_s, self.must_be_started = time.monotonic(), False

    def see(self, status: BoardStatus) -> None:
        """Take a status in."""
        if status.state == _IDLE and time.monotonic() - self._started_s > _SETTLE_S:
            self.must_be_started = True


class WallClockWatch:
    """Tells jumps of the wall clock against the monotonic one."""

    def __init__(self) -> None:
        self._difference_ns: int | None = None

    def jump_s(self, chunk: Chunk) -> float | None:
        """By how much the clock was set since the chunk before, s; None where it was not."""
        difference_ns = chunk.wall_ns - chunk.monotonic_ns
        before, self._difference_ns = self._difference_ns, difference_ns
        if before is None or abs(difference_ns - before) < _JUMP_S * 1e9:
            return None
        return (difference_ns - before) * 1e-9
