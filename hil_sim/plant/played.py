"""A joint reference from a file, as `impid-host design` writes it, for the robot's controller to follow."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Played:
    """Rows of a file, one per tick; at its end the robot rests where it is.

    Attributes:
        rows: q1, q2 (rad), w1, w2 (rad/s), shape (n, 4).
    """

    rows: Array

    @property
    def start_rad(self) -> Array:
        """Joint angles at which the robot rests before the start, shape (2,)."""
        return self.rows[0, :2]

    def ticked(self, tick_s: float) -> "Played":  # noqa: ARG002  (its rows are the ticks)
        """On the ticks of a controller with this period: the file's rows, whatever its clock's rate."""
        return self

    def ticks(self, first: int, count: int) -> Array:
        """Rows for ticks first to first + count - 1, shape (count, 4)."""
        wanted = np.arange(first, first + count)
        result = self.rows[np.clip(wanted, 0, len(self.rows) - 1)]
        result[wanted >= len(self.rows), 2:] = 0.0
        return result


def played_reference(path: Path, tick_s: float, *, joints: int = 2) -> Played:
    """The motion of a CSV with the columns t (s), theta1, omega1, ... (rad, rad/s), one row per tick.

    Args:
        joints: how many the file is of; a single axis' second joint stands at zero.

    Raises:
        ValueError: the file cannot be read, lacks a column, or has another rate.
    """
    try:
        table = np.genfromtxt(path, delimiter=",", names=True)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
    wanted = [f"{name}{joint + 1}" for joint in range(joints) for name in ("theta", "omega")]
    names = table.dtype.names or ()
    if not {"t", *wanted} <= set(names) or table.ndim != 1 or table.size < 2:
        raise ValueError(f"{path}: needs the columns t, {', '.join(wanted)}")
    rows = np.zeros((table.size, 4))
    for joint in range(joints):
        rows[:, joint], rows[:, 2 + joint] = table[f"theta{joint + 1}"], table[f"omega{joint + 1}"]
    if not np.all(np.isfinite(rows)):
        raise ValueError(f"{path}: an angle or a speed is not a number")
    if np.max(np.abs(np.diff(table["t"]) / tick_s - 1.0)) > 1e-3:
        raise ValueError(f"{path}: needs {1 / tick_s:g} rows a second")
    return Played(rows)
