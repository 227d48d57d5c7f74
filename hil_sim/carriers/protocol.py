"""What the serving loop asks of a carrier of serial bytes."""

from typing import Protocol


class Carrier(Protocol):
    """One line between the board and one client at a time. Nothing blocks but `receive`."""

    @property
    def address(self) -> str:
        """What a client opens."""

    @property
    def connected(self) -> bool:
        """A client holds the line open."""

    @property
    def dropped(self) -> int:
        """Bytes lost because the client did not read."""

    def receive(self, timeout_s: float) -> bytes:
        """Waits until bytes come, at most timeout_s, and returns them; b"" if none came."""

    def send(self, data: bytes) -> None:
        """Hands bytes to the client; without one they are gone, as on a cable that ends nowhere."""

    def close(self) -> None:
        """Takes the line down."""
