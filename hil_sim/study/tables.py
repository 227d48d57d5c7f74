"""The two CSV files of a trial, written block by block."""

from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import csv

from hil_sim.board.wire import Samples
from hil_sim.sensors.torque_log import LogRows

NO_HEADER = csv.WriteOptions(include_header=False)


class _CsvFile:
    """A header line, then rows as they come; what was written survives a kill."""

    def __init__(self, path: Path, columns: list[str]) -> None:
        self._file = path.open("wb")
        self._file.write((",".join(columns) + "\n").encode())
        self._columns = columns

    def write(self, arrays: list[NDArray[Any]]) -> None:
        """One array per column."""
        table = pa.table([pa.array(array) for array in arrays], names=self._columns)
        csv.write_csv(table, self._file, NO_HEADER)

    def flush(self) -> None:
        """Hands everything to the operating system."""
        self._file.flush()

    def close(self) -> None:
        """Closes the file; may be called twice."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class RobotCsv(_CsvFile):
    """robot.csv: what the robot's controller logs."""

    def __init__(
        self, path: Path, *, with_force: bool, with_command: bool = False, single: bool = False
    ) -> None:
        """single: one axis alone."""
        self._joints = 1 if single else 2
        joints = [f"{name}{joint + 1}" for name in ("theta", "tau") for joint in range(self._joints)]
        force = ["fx", "fy"] if with_force else []
        command = ["fdx", "fdy"] if with_command else []
        super().__init__(path, ["t", *joints, *force, *command])

    def add(self, rows: LogRows) -> None:
        """Appends rows; digits beyond what any sensor resolves are left out."""
        theta, tau = np.round(rows.theta_rad, 9), np.round(rows.tau_Nm, 7)
        arrays = [rows.t_s, *theta.T[: self._joints], *tau.T[: self._joints]]
        if rows.force_N is not None:
            force = np.round(rows.force_N, 5)
            arrays += [force[:, 0], force[:, 1]]
        if rows.command_N is not None:
            command = np.round(rows.command_N, 5)
            arrays += [command[:, 0], command[:, 1]]
        self.write(arrays)


class DeviceCsv(_CsvFile):
    """device.csv: what the board sent."""

    def __init__(self, path: Path, *, third_axis: bool = False) -> None:
        names = ["t_us", "seq", "ax", "ay", "enc1", "enc2", "flags"]
        super().__init__(path, [*names, "az"] if third_axis else names)

    def add(self, samples: Samples) -> None:
        """Appends samples."""
        s = samples
        columns: list[NDArray[Any]] = [s.t_us, s.seq, s.ax, s.ay, s.enc1, s.enc2, s.flags]
        self.write(columns if s.az is None else [*columns, s.az])
