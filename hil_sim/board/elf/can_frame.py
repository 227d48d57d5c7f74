"""A frame on the CAN bus, and how long it takes."""

from dataclasses import dataclass

from hil_sim.board.elf.chip import lib


@dataclass(frozen=True)
class Frame:
    """A classic data frame with an 11-bit identifier."""

    identifier: int
    data: bytes


def frame_bits(length: int) -> int:
    """Longest standard data frame with `length` bytes, interframe space included (can.c)."""
    return int(lib.can_frame_bits(length))
