"""A serial line on which things go wrong: a `Carrier` in front of another."""

from collections.abc import Callable

from hil_sim.carriers.protocol import Carrier
from hil_sim.faults.damage import Damage
from hil_sim.faults.throttle import Throttle


class FaultyLine:
    """Implements `Carrier`; passes everything on unchanged as long as nothing is wrong."""

    def __init__(self, carrier: Carrier, clock_us: Callable[[], int]) -> None:
        """`clock_us` shows board time."""
        self._carrier = carrier
        self._clock_us = clock_us
        self.to_host: list[Damage] = []
        self.to_board: list[Damage] = []
        self._stalled = False
        self._held_to_host = b""
        self._held_to_board = b""
        self._throttle: Throttle | None = None

    @property
    def address(self) -> str:
        """What a client opens."""
        return self._carrier.address

    @property
    def connected(self) -> bool:
        """A client is there."""
        return self._carrier.connected

    @property
    def dropped(self) -> int:
        """Bytes lost because the client did not read, apart from those of a fault."""
        return self._carrier.dropped

    def pull(self) -> None:
        """Pulls the cable; what was on its way is gone."""
        self._carrier.pull()
        self._held_to_host = self._held_to_board = b""

    def plug(self) -> None:
        """Puts the cable back."""
        self._carrier.plug()

    def close(self) -> None:
        """Takes the line down."""
        self._carrier.close()

    def stall(self) -> None:
        """From now on nothing passes."""
        self._stalled = True

    def resume(self) -> int:
        """Everything that waited passes at once; how many bytes."""
        self._stalled = False
        held, self._held_to_host = self._held_to_host, b""
        if held:
            self._carrier.send(held)
        return len(held) + len(self._held_to_board)

    def throttle(self, bytes_per_s: float, buffer_bytes: int) -> None:
        """From now on the client fetches slowly."""
        self._throttle = Throttle(bytes_per_s, buffer_bytes, self._clock_us())

    def unthrottle(self) -> int:
        """The client fetches what the buffer holds; how many bytes were lost until now."""
        if self._throttle is None:
            return 0
        self._carrier.send(b"".join(self._throttle.rest()))
        lost, self._throttle = self._throttle.lost, None
        return lost

    def receive(self, timeout_s: float) -> bytes:
        """Waits until bytes come, at most timeout_s, and returns those that the board gets."""
        data = self._carrier.receive(timeout_s)
        for damage in self.to_board:
            data = damage(data)
        self._fetch()
        if self._stalled:
            self._held_to_board += data
            return b""
        held, self._held_to_board = self._held_to_board, b""
        return held + data

    def send(self, data: bytes) -> None:
        """Hands the client what is left of the bytes."""
        for damage in self.to_host:
            data = damage(data)
        if self._stalled:
            self._held_to_host += data
        elif self._throttle is not None:
            for byte in data:
                self._throttle.put(1, bytes((byte,)))
            self._fetch()
        else:
            self._carrier.send(data)

    def _fetch(self) -> None:
        if self._throttle is not None and not self._stalled:
            self._carrier.send(b"".join(self._throttle.take(self._clock_us())))
