"""`robot.csv`: the torque log of the robot's controller."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impid_host.errors import InputError
from impid_host.robot.model import ROBOTS
from impid_host.study.csv_table import read_columns, read_header, write_columns
from impid_host.study.model import RobotLog, RobotModelName
from impid_host.study.robot_log import FORCE_PAIRS, log_columns, reference_columns, robot_log

_FLOAT = np.dtype(np.float64)


def joint_count(model: RobotModelName, columns: list[str]) -> int:
    """How many joints a log of this robot model has; where the model does not say, columns are counted."""
    declared = ROBOTS[model].joints
    if declared is not None:
        return declared
    n = 0
    while f"theta{n + 1}" in columns:
        n += 1
    return max(n, 1)


def read_robot_log(path: Path, model: RobotModelName, also: Sequence[str] = ()) -> RobotLog:
    """Read `robot.csv`; the columns' order does not matter, columns of other names than `also` are ignored.

    The log handed out has strictly increasing `t`: see `study.robot_log.robot_log`. A text clock is read.

    Raises:
        InputError: missing file or column, unreadable cell, time going backwards or jumping; names the row.
    """
    header = read_header(path)
    n = joint_count(model, header)
    forces = [name for pair in FORCE_PAIRS for name in pair if name in header]
    references = [name for name in reference_columns(n) if name in header]
    missing = [name for name in also if name not in header]
    if missing:
        raise InputError(path, f"has no column {missing[0]}", f"it has {', '.join(header)}")
    types: dict[str, np.dtype[Any]] = dict.fromkeys([*log_columns(n), *forces, *references, *also], _FLOAT)
    if "sync" in header:
        types["sync"] = np.dtype(np.uint8)
    empty = [*forces, *(name for name in also if name != "sync")]
    table = read_columns(path, types, may_be_empty=empty, clocks=("t",), header=header)
    return robot_log(table, n, also)


def write_robot_log(log: RobotLog, path: Path) -> None:
    """Write `robot.csv`, with the stamps as they were logged; reading it back gives the same bits."""
    columns: dict[str, NDArray[np.generic]] = {"t": log.t if log.t_written is None else log.t_written}
    columns |= {f"theta{i + 1}": log.theta[:, i] for i in range(log.theta.shape[1])}
    columns |= {f"tau{i + 1}": log.tau[:, i] for i in range(log.tau.shape[1])}
    if log.force is not None:
        columns |= {"fx": log.force[:, 0], "fy": log.force[:, 1]}
    if log.perturbation is not None:
        columns |= {"fdx": log.perturbation[:, 0], "fdy": log.perturbation[:, 1]}
    if log.reference is not None:
        columns |= {f"theta{i + 1}_ref": log.reference[:, i] for i in range(log.reference.shape[1])}
    if log.sync is not None:
        columns["sync"] = log.sync
    columns |= {name: values for name, values in log.columns.items() if name not in columns}
    write_columns(path, columns)
