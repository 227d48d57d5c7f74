"""Which board time it is, by the clock on the wall."""

import time


class Pace:
    """Maps the machine's monotonic clock to the board's clock."""

    def __init__(self, board_us: int, speed: float, board_rate: float) -> None:
        """The board shows board_us now, and from now on gains speed * board_rate seconds per second."""
        self._factor = 1e-3 * speed * board_rate  # board microseconds per nanosecond
        self.set(board_us)

    def set(self, board_us: int) -> None:
        """The board shows board_us now."""
        self._begin_ns = time.monotonic_ns()
        self._board_us = board_us

    def now_us(self) -> int:
        """What the board's clock should show."""
        return self._board_us + int((time.monotonic_ns() - self._begin_ns) * self._factor)

    def seconds_until(self, board_us: int) -> float:
        """Seconds on the wall until the board shows board_us; 0 if that is past."""
        due_ns = self._begin_ns + (board_us - self._board_us) / self._factor
        return max(0.0, 1e-9 * (due_ns - time.monotonic_ns()))

    def shift(self, by_us: int) -> None:
        """From now on the board shows by_us more."""
        self._board_us += by_us
