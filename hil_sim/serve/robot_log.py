"""The robot's log file while the robot moves."""

import os
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from hil_sim.sensors.torque_log import LogRows, joined
from hil_sim.study.tables import RobotCsv

ROWS_AT_ONCE = 100


class LiveRobotLog:
    """Appends rows to robot.csv a tenth of a second at a time; on disk and complete after `finish`."""

    def __init__(self, path: Path, *, with_force: bool, with_command: bool = False) -> None:
        self._path = path
        self._csv = RobotCsv(path, with_force=with_force, with_command=with_command)
        # The first write of all loads half of pyarrow, a tenth of a second: now, while the robot rests.
        self._csv.add(_no_rows(with_force=with_force, with_command=with_command))
        self._csv.flush()
        self._waiting: list[LogRows] = []
        self._zero_s: float | None = None  # stamp of the first row
        self._truncated = False
        self.rows = 0

    def add(self, rows: list[LogRows]) -> None:
        """Takes the next rows."""
        if self._truncated:
            return
        rows = [part for part in rows if part.t_s.size]
        if rows and self._zero_s is None:
            self._zero_s = float(rows[0].t_s[0])
        self._waiting += rows
        if sum(part.t_s.size for part in self._waiting) >= ROWS_AT_ONCE:
            self._write()

    def finish(self) -> None:
        """Writes what waits and closes the file; may be called twice."""
        self._write()
        self._csv.close()

    def truncate(self, at_s: float) -> int:
        """Ends the log within the last row before at_s, counted from its first; how many whole rows stay."""
        end_s = at_s + (self._zero_s or 0.0)
        self._waiting = [_before(part, end_s) for part in self._waiting]
        self.finish()
        self._truncated = True
        if self.rows:
            text = self._path.read_bytes()
            last = text.rindex(b"\n", 0, -1) + 1
            os.truncate(self._path, last + (len(text) - last) // 2)
            self.rows -= 1
        return self.rows

    def _write(self) -> None:
        if self._waiting:
            rows = joined(self._waiting)
            self._waiting = []
            self.rows += rows.t_s.size
            self._csv.add(rows)
            self._csv.flush()


def _before(rows: LogRows, end_s: float) -> LogRows:
    keep = rows.t_s < end_s
    columns = {column.name: getattr(rows, column.name) for column in fields(rows)}
    kept: dict[str, Any] = {
        name: values if values is None else values[keep] for name, values in columns.items()
    }
    return LogRows(**kept)


def _no_rows(*, with_force: bool, with_command: bool) -> LogRows:
    pairs = np.zeros((0, 2))
    return LogRows(
        t_s=np.zeros(0),
        theta_rad=pairs,
        tau_Nm=pairs,
        force_N=pairs if with_force else None,
        command_N=pairs if with_command else None,
    )
