"""A frame on the CAN bus, how long it takes, and the mailbox that it waits in."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Frame:
    """A classic data frame with an 11-bit identifier."""

    identifier: int
    data: bytes


def frame_bits(length: int) -> int:
    """Longest standard data frame with `length` bytes, interframe space included.

    44 bits and the data, 3 of interframe space, and a stuff bit after each four of the 34 + 8 n bits that
    can be stuffed (after the first five).
    """
    return 44 + 8 * length + (34 + 8 * length - 1) // 4 + 3


class Mailbox:
    """A transmit mailbox."""

    def __init__(self) -> None:
        self.words = [0, 0, 0, 0]  # TIR, TDTR, TDLR, TDHR
        self.order = 0

    @property
    def frame(self) -> Frame:
        """What it holds."""
        length = min(self.words[1] & 15, 8)
        data = (self.words[2] | self.words[3] << 32).to_bytes(8, "little")
        return Frame(self.words[0] >> 21, data[:length])
