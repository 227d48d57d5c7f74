"""Which date holds for which sample of a piece of the bus."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impid_host.samples import FLAG_RESET

UNDATED = -1


@dataclass(frozen=True, slots=True)
class Date:
    """The sample `index` (32 bit) of boot `boot_id` belongs to t_us; holds from frame `position` on."""

    position: int
    boot_id: int
    index: int
    t_us: int


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
