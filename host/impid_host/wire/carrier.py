"""The two carriers side by side: how a command is written on each, and who decodes what comes back."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from impid_host.wire.can_frames import CAN_FRAME, CanBytesDecoder, encode_can_command
from impid_host.wire.decoder import LinkCounts, SerialDecoder
from impid_host.wire.frame import DELIMITER, encode_command
from impid_host.wire.records import Decoded
from impid_host.wire.tracker import Position


class Decoder(Protocol):
    """Bytes of a carrier to samples, statuses and answers."""

    @property
    def counts(self) -> LinkCounts:
        """Totals since the decoder was made."""

    def resume(self, position: Position) -> None:
        """Begin in the middle of a stream, of which this sample comes next."""

    def feed(self, data: bytes) -> Decoded:
        """What `data` completes."""


@dataclass(frozen=True, slots=True)
class Carrier:
    """Serial line or CAN bus.

    Attributes:
        name: "serial" or "can".
        decoder: makes a decoder of the stream.
        encode_command: request id, opcode, item and value to bytes.
        preamble: ends whatever half frame noise may have left in the board's parser.
        piece_bytes: stored bytes may be cut at multiples of this.
    """

    name: str
    decoder: Callable[[], Decoder]
    encode_command: Callable[[int, int, int, int], bytes]
    preamble: bytes
    piece_bytes: int


SERIAL = Carrier("serial", SerialDecoder, encode_command, DELIMITER, 1)
CAN = Carrier("can", CanBytesDecoder, encode_can_command, b"", CAN_FRAME.itemsize)
