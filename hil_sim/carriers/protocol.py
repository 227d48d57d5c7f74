"""What the serving loop asks of a carrier: of serial bytes, or of CAN frames."""

from typing import Protocol

# Identifier (11 bits) and data of a classic frame, as the board takes and gives them.
CanFrame = tuple[int, bytes]


class Cable(Protocol):
    """What both kinds have: a place to connect to, and a cable that can be pulled."""

    @property
    def address(self) -> str:
        """What a client opens; may change after `plug`."""

    @property
    def connected(self) -> bool:
        """A client is there."""

    @property
    def dropped(self) -> int:
        """Bytes or frames lost because the client did not read."""

    def pull(self) -> None:
        """Pulls the cable: the client loses the connection, and nobody can connect."""

    def plug(self) -> None:
        """Puts the cable back."""

    def close(self) -> None:
        """Takes the carrier down."""


class Carrier(Cable, Protocol):
    """One line between the board and one client at a time. Nothing blocks but `receive`."""

    def receive(self, timeout_s: float) -> bytes:
        """Waits until bytes come, at most timeout_s, and returns them; b"" if none came."""

    def send(self, data: bytes) -> None:
        """Hands bytes to the client; without one they are gone, as on a cable that ends nowhere."""


class CanCarrier(Cable, Protocol):
    """A bus with the board on it. Nothing blocks but `receive`."""

    @property
    def config(self) -> dict[str, str | int]:
        """Keyword arguments with which `can.Bus` joins."""

    def receive(self, timeout_s: float) -> list[CanFrame]:
        """Waits until frames come, at most timeout_s, and returns them; [] if none came."""

    def send(self, frames: list[CanFrame]) -> None:
        """Puts frames on the bus."""
