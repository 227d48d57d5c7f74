"""The robot's log file while the robot moves."""

from pathlib import Path

import numpy as np

from hil_sim.sensors.torque_log import LogRows, joined
from hil_sim.study.tables import RobotCsv

ROWS_AT_ONCE = 100


class LiveRobotLog:
    """Appends rows to robot.csv a tenth of a second at a time; on disk and complete after `finish`."""

    def __init__(self, path: Path, *, with_force: bool) -> None:
        self._csv = RobotCsv(path, with_force=with_force)
        # The first write of all loads half of pyarrow, a tenth of a second: now, while the robot rests.
        self._csv.add(_no_rows(with_force=with_force))
        self._csv.flush()
        self._waiting: list[LogRows] = []
        self.rows = 0

    def add(self, rows: list[LogRows]) -> None:
        """Takes the next rows."""
        self._waiting += rows
        if sum(part.t_s.size for part in self._waiting) >= ROWS_AT_ONCE:
            self._write()

    def finish(self) -> None:
        """Writes what waits and closes the file; may be called twice."""
        self._write()
        self._csv.close()

    def _write(self) -> None:
        if self._waiting:
            rows = joined(self._waiting)
            self._waiting = []
            self.rows += rows.t_s.size
            self._csv.add(rows)
            self._csv.flush()


def _no_rows(*, with_force: bool) -> LogRows:
    pairs = np.zeros((0, 2))
    return LogRows(t_s=np.zeros(0), theta_rad=pairs, tau_Nm=pairs, force_N=pairs if with_force else None)
