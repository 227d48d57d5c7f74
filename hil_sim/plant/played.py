"""A joint reference from a file, as `impid-host design` writes it, for the robot's controller to follow."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hil_sim.plant.table import columns_of

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
    names = [f"{name}{joint + 1}" for joint in range(joints) for name in ("theta", "omega")]
    table = columns_of(path, names, 1 / tick_s, "an angle or a speed")
    rows = np.zeros((len(table), 4))
    rows[:, :joints], rows[:, 2 : 2 + joints] = table[:, ::2], table[:, 1::2]
    return Played(rows)
