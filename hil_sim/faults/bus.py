"""A bus on which things go wrong: a `CanCarrier` in front of another."""

from collections.abc import Callable

import numpy as np

from hil_sim.carriers.protocol import CanCarrier, CanFrame
from hil_sim.faults.chance import RareEvents
from hil_sim.faults.throttle import Throttle

FRAME_BYTES = 14  # on the bus: 47 bits around 64 of data, without stuffing


class FaultyBus:
    """Implements `CanCarrier`; passes everything on unchanged as long as nothing is wrong."""

    def __init__(self, carrier: CanCarrier, clock_us: Callable[[], int]) -> None:
        """`clock_us` shows board time."""
        self._carrier = carrier
        self._clock_us = clock_us
        self.filters: list[FrameDamage] = []
        self._held_to_host: list[CanFrame] = []
        self._held_to_board: list[CanFrame] = []
        self._stalled = False
        self._throttle: Throttle | None = None
        self._shorted = False
        self._swallowed = 0

    @property
    def address(self) -> str:
        """The channel."""
        return self._carrier.address

    @property
    def config(self) -> dict[str, str | int]:
        """Keyword arguments with which `can.Bus` joins."""
        return self._carrier.config

    @property
    def connected(self) -> bool:
        """A client is there."""
        return self._carrier.connected

    @property
    def dropped(self) -> int:
        """Lost because the client did not read, apart from what a fault took."""
        return self._carrier.dropped

    def pull(self) -> None:
        """Pulls the cable; what was on its way is gone."""
        self._carrier.pull()
        self._held_to_host, self._held_to_board = [], []

    def plug(self) -> None:
        """Puts the cable back."""
        self._carrier.plug()

    def close(self) -> None:
        """Takes the bus down."""
        self._carrier.close()

    def stall(self) -> None:
        """From now on nothing passes between adapter and client."""
        self._stalled = True

    def resume(self) -> int:
        """Everything that waited passes at once; how many frames."""
        self._stalled = False
        held, self._held_to_host = self._held_to_host, []
        self._carrier.send(held)
        return len(held) + len(self._held_to_board)

    def short(self) -> None:
        """From now on no frame gets through."""
        self._shorted = True
        self._swallowed = 0

    def unshort(self) -> int:
        """The short is gone; how many frames of the board it took."""
        self._shorted = False
        return self._swallowed

    def throttle(self, bytes_per_s: float, buffer_bytes: int) -> None:
        """From now on the client fetches slowly."""
        self._throttle = Throttle(bytes_per_s, buffer_bytes, self._clock_us())

    def unthrottle(self) -> int:
        """The client fetches what the buffer holds; how many frames were lost until now."""
        if self._throttle is None:
            return 0
        self._carrier.send([_frame(piece) for piece in self._throttle.rest()])
        lost, self._throttle = self._throttle.lost // FRAME_BYTES, None
        return lost

    def receive(self, timeout_s: float) -> list[CanFrame]:
        """Waits until frames come, at most timeout_s, and returns those that the board gets."""
        frames = self._carrier.receive(timeout_s)
        self._fetch()
        if self._shorted:
            return []
        if self._stalled:
            self._held_to_board += frames
            return []
        held, self._held_to_board = self._held_to_board, []
        return held + frames

    def send(self, frames: list[CanFrame]) -> None:
        """Hands the client what is left of the frames."""
        if self._shorted:
            self._swallowed += len(frames)
            return
        for damage in self.filters:
            frames = damage(frames)
        if self._stalled:
            self._held_to_host += frames
        elif self._throttle is not None:
            for number, data in frames:
                self._throttle.put(FRAME_BYTES, number.to_bytes(2, "little") + data)
            self._fetch()
        else:
            self._carrier.send(frames)

    def _fetch(self) -> None:
        if self._throttle is not None and not self._stalled:
            self._carrier.send([_frame(piece) for piece in self._throttle.take(self._clock_us())])


class FrameDamage:
    """Single frames come `times` times instead of once; `rate` is per frame."""

    def __init__(self, times: int, rate: float, generator: np.random.Generator) -> None:
        self._times = times
        self._events = RareEvents(rate, generator)
        self.count = 0

    def __call__(self, frames: list[CanFrame]) -> list[CanFrame]:
        """The frames as they arrive."""
        hits = set(self._events.within(len(frames)).tolist())
        self.count += len(hits)
        return [frame for i, frame in enumerate(frames) for _ in range(self._times if i in hits else 1)]


def _frame(piece: bytes) -> CanFrame:
    return int.from_bytes(piece[:2], "little"), piece[2:]
