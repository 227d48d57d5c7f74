"""What a connection to the board is, whichever carrier it runs over."""

import time
from dataclasses import dataclass
from typing import Protocol, Self

from impid_host.wire.carrier import Carrier


@dataclass(frozen=True, slots=True)
class Chunk:
    """Bytes as one call gave or took them, and when: the host's monotonic and wall clocks, ns.

    On CAN the bytes are packed frames, see `impid_host.wire.can_frames`.
    """

    monotonic_ns: int
    wall_ns: int
    data: bytes

    @classmethod
    def now(cls, data: bytes) -> Self:
        """A chunk stamped with this moment."""
        return cls(monotonic_ns=time.monotonic_ns(), wall_ns=time.time_ns(), data=data)


class Link(Protocol):
    """An open connection. Chunks wait in order until `receive` takes them; close it when done."""

    name: str
    carrier: Carrier

    def send(self, data: bytes) -> Chunk:
        """Write everything; the stamp is taken just before.

        Raises:
            LinkError: the connection is gone.
        """

    def receive(self, timeout_s: float) -> Chunk | None:
        """The next chunk, or None when nothing came in time.

        Raises:
            LinkError: the connection is gone and every chunk that came before has been taken.
        """

    def close(self) -> None:
        """Let go of it; one that is gone already is no error."""
