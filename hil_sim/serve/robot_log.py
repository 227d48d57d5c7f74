"""The robot's log file while the robot moves."""

from pathlib import Path

from hil_sim.sensors.torque_log import LogRows, joined
from hil_sim.study.tables import RobotCsv

ROWS_AT_ONCE = 100


class LiveRobotLog:
    """Appends rows to robot.csv a tenth of a second at a time; on disk and complete after `finish`."""

    def __init__(self, path: Path, *, with_force: bool) -> None:
        self._csv = RobotCsv(path, with_force=with_force)
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
