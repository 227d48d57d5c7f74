"""A buffer that is emptied slowly and loses what it cannot hold."""

from collections import deque


class Throttle:
    """Pieces pass at `per_s` cost a second; up to `capacity` cost waits, what comes then is lost."""

    def __init__(self, per_s: float, capacity: int, now_us: int) -> None:
        self._per_us = 1e-6 * per_s
        self._capacity = capacity
        self._at_us = now_us
        self._credit = 0.0
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._cost = 0
        self.lost = 0

    def put(self, cost: int, piece: bytes) -> None:
        """A piece arrives at the buffer."""
        if self._cost + cost > self._capacity:
            self.lost += cost
            return
        self._waiting.append((cost, piece))
        self._cost += cost

    def take(self, now_us: int) -> list[bytes]:
        """What has been fetched until now_us."""
        # An empty buffer saves nothing up; a full one no more than it holds.
        self._credit = min(self._credit + (now_us - self._at_us) * self._per_us, float(self._cost))
        self._at_us = max(self._at_us, now_us)
        taken = []
        while self._waiting and self._waiting[0][0] <= self._credit:
            cost, piece = self._waiting.popleft()
            self._credit -= cost
            self._cost -= cost
            taken.append(piece)
        return taken

    def rest(self) -> list[bytes]:
        """Everything that still waits: the reader is awake again."""
        pieces = [piece for _, piece in self._waiting]
        self._waiting.clear()
        self._cost = 0
        return pieces
