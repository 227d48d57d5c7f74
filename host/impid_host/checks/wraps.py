"""Counters and angles that jump back by one fixed size: found, and put together again."""

from dataclasses import dataclass

import numpy as np

from impid_host.signals.arrays import Floats

_FEW = 0.02  # more jumps than this share of the rows are noise, not wraps
_ALIKE = 0.1


@dataclass(frozen=True, slots=True)
class Unwrapped:
    """A channel without its wraps.

    Attributes:
        values: (N,).
        size: of one wrap, in the channel's unit; 0 where there was none.
        first_row: index of the first value after a wrap.
    """

    values: Floats
    size: float
    first_row: int = 0


def unwrapped(values: Floats, likely: tuple[float, ...]) -> Unwrapped:
    """Join a channel (N,) that jumps back and forth by one size.

    Args:
        likely: sizes that have a reason (2**16, a turn); one near the size that is seen is taken for it.
    """
    steps = np.diff(values)
    if len(steps) < 10:
        return Unwrapped(values, 0.0)
    usual = float(np.quantile(np.abs(steps), 1 - _FEW))
    large = np.flatnonzero(np.abs(steps) > max(20 * usual, 1e-9))
    if len(large) == 0:
        return Unwrapped(values, 0.0)
    seen = float(np.median(np.abs(steps[large])))
    size = next((one for one in likely if abs(seen / one - 1) < _ALIKE), 0.0)
    if size == 0.0:
        return Unwrapped(values, 0.0)
    turns = np.round(steps / size)
    if np.max(np.abs(steps[large] / size - turns[large])) > _ALIKE:
        return Unwrapped(values, 0.0)
    joined = values.copy()
    joined[1:] -= size * np.cumsum(turns)
    return Unwrapped(joined, size, int(large[0]) + 1)
