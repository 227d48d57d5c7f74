"""A table that the robot plays, from a CSV with a head, one row per tick."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_LATE = 1e-3  # of a tick


def columns_of(path: Path, names: Sequence[str], rate_hz: float, what: str) -> Array:
    """The named columns, shape (n, len(names)), of a file that has t (s) besides.

    Args:
        what: that a cell is, for the message where it is not a number.

    Raises:
        ValueError: the file cannot be read, lacks a column, or has another rate.
    """
    try:
        table = np.genfromtxt(path, delimiter=",", names=True)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
    wanted = ("t", *names)
    if not set(wanted) <= set(table.dtype.names or ()) or table.ndim != 1 or table.size < 2:
        raise ValueError(f"{path}: needs the columns {', '.join(wanted)}")
    rows = np.stack([table[name] for name in names], axis=1)
    if not np.all(np.isfinite(rows)):
        raise ValueError(f"{path}: {what} is not a number")
    if np.max(np.abs(np.diff(table["t"]) * rate_hz - 1.0)) > _LATE:
        raise ValueError(f"{path}: needs {rate_hz:g} rows a second")
    return rows
