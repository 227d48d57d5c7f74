"""Which date holds for which sample of a piece of the bus, and which sample was the latest before a frame."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from impid_host.samples import FLAG_RESET
from impid_host.wire.messages import Words

UNDATED = -1
MASK32 = 0xFFFFFFFF


@dataclass(frozen=True, slots=True)
class Date:
    """The sample `index` (32 bit) of boot `boot_id` belongs to t_us; holds from frame `position` on."""

    position: int
    boot_id: int
    index: int
    t_us: int


@dataclass(frozen=True, slots=True)
class Placed:
    """Where the samples of a piece stood in it and what they say, each (N,); `before` is the one in front."""

    position: NDArray[np.intp]
    boot_id: NDArray[np.uint16]
    t_us: Words
    index: NDArray[np.unsignedinteger[Any]]
    before: tuple[int, int, int]

    @classmethod
    def none(cls, before: tuple[int, int, int] = (0, 0, 0)) -> Self:
        nothing = np.zeros(0, np.uint64)
        return cls(np.zeros(0, np.intp), np.zeros(0, np.uint16), nothing, nothing, before)

    def latest(self, position: int) -> tuple[int, int, int]:
        """Boot, time and next index as the latest sample before that position has them."""
        n = int(np.searchsorted(self.position, position)) - 1
        if n < 0:
            return self.before
        return int(self.boot_id[n]), int(self.t_us[n]), (int(self.index[n]) + 1) & MASK32

    def latest_each(self, positions: NDArray[np.intp]) -> tuple[Words, Words, Words]:
        """The same of several positions, each (N,)."""
        n = np.searchsorted(self.position, positions)
        columns = [column.astype(np.uint64) for column in (self.boot_id, self.t_us, self.index)]
        columns[2] += np.uint64(1)
        told = [np.append(np.uint64(old), new)[n] for old, new in zip(self.before, columns, strict=True)]
        return told[0], told[1], told[2] & np.uint64(MASK32)


def date_of(position: NDArray[np.intp], dates: list[Date], breaks: list[int]) -> NDArray[np.intp]:
    """For each sample the date that holds for it, or UNDATED; shape (N,)."""
    at = np.array([date.position for date in dates], dtype=np.intp)
    which = np.searchsorted(at, position, side="right") - 1
    # Position -1 is the date, and the first half, that the piece before left behind.
    for start in breaks:
        stale = (position > start) & ((which < 0) | (np.append(at, -1)[which] < start))
        which[stale] = UNDATED
    return which


def forget_at_resets(
    which: NDArray[np.intp], flags: NDArray[np.uint8], dates: list[Date], *, used: bool
) -> None:
    """The first sample of a boot that has no date of its own: the date at hand belongs to the boot before.

    `used` says whether the first of the dates has dated samples of an earlier piece.
    """
    for reset in np.flatnonzero(flags & FLAG_RESET).tolist():
        date = which[reset]
        old = date == which[reset - 1] if reset else used and date == 0 and dates[0].position == -1
        if old:
            which[reset:][which[reset:] == date] = UNDATED
