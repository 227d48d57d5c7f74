"""`robot.csv`: the torque log of the robot's controller."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from impid_host.errors import InputError
from impid_host.study.csv_table import CsvTable, read_columns, read_header, write_columns
from impid_host.study.model import Floats, RobotLog, RobotModelName
from impid_host.study.notices import notice

_FLOAT = np.dtype(np.float64)
_PAIRS = (("fx", "fy"), ("fdx", "fdy"))
# No arm, spring or laboratory robot gets near these; a larger value is a wrong unit or a broken cell.
_LIMIT = {"t": 1e11, "theta": 1e5, "tau": 1e6, "f": 1e6}


def joint_count(model: RobotModelName, columns: list[str]) -> int:
    """How many joints a log of this robot model has; a URDF robot's are counted in the columns."""
    if model in ("slide-1d", "joint-1d"):
        return 1
    if model == "urdf":
        n = 0
        while f"theta{n + 1}" in columns:
            n += 1
        return max(n, 1)
    return 2


def read_robot_log(path: Path, model: RobotModelName) -> RobotLog:
    """Read `robot.csv`; the columns' order does not matter, columns of other names are ignored.

    The log handed out has strictly increasing `t`. A row that repeats its predecessor's stamp is left out
    with a warning; values are never altered.

    Raises:
        InputError: missing file or column, unreadable cell, time going backwards; names the row.
    """
    header = read_header(path)
    n = joint_count(model, header)
    wanted = ["t", *(f"theta{i + 1}" for i in range(n)), *(f"tau{i + 1}" for i in range(n))]
    optional: list[str] = []
    for pair in _PAIRS:
        present = [name for name in pair if name in header]
        if len(present) == 1:
            missing = next(name for name in pair if name not in header)
            raise InputError(path, f"has column {present[0]} but no {missing}", "add or remove it", row=1)
        optional += present
    integer = {"sync": np.dtype(np.uint8)} if "sync" in header else {}
    types = dict.fromkeys([*wanted, *optional], _FLOAT) | integer
    table = read_columns(path, types, may_be_empty=optional, header=header)
    _check_values(table)
    return _log(table, n, _increasing(table))


def _check_values(table: CsvTable) -> None:
    for name, column in table.columns.items():
        if name == "sync":
            wrong = column > 1
            what = "a level other than 0 and 1"
        else:
            limit = _LIMIT[next(kind for kind in ("theta", "tau", "t", "f") if name.startswith(kind))]
            with np.errstate(invalid="ignore"):
                wrong = np.abs(column) > limit
            what = f"a magnitude above {limit:.0e}, which nothing measured has"
        if wrong.any():
            index = int(np.argmax(wrong))
            remedy = "check the unit or the value"
            raise InputError(table.path, f"column {name} holds {what}", remedy, row=table.row(index))


def _increasing(table: CsvTable) -> NDArray[np.bool_]:
    """Which rows to keep so that `t` increases strictly, shape (N,).

    Raises:
        InputError: the time goes backwards.
    """
    t = table.columns["t"]
    step = np.diff(t)
    if (step < 0).any():
        index = int(np.argmax(step < 0)) + 1
        what = f"t goes backwards, from {t[index - 1]} s to {t[index]} s"
        remedy = "sort the rows by t, or put what follows a restart into a trial of its own"
        raise InputError(table.path, what, remedy, row=table.row(index))
    keep = np.concatenate(([True], step > 0))
    repeated = ~keep
    if repeated.any():
        same = repeated.copy()
        for column in table.columns.values():
            same[1:] &= (column[1:] == column[:-1]) | (
                (column[1:] != column[1:]) & (column[:-1] != column[:-1])
            )
        other = int((repeated & ~same).sum())
        first = table.row(int(np.argmax(repeated)))
        detail = f", {other} of them with other values" if other else ""
        count = int(repeated.sum())
        notice(
            f"{table.path}: {count} rows repeat the stamp before them{detail} (first in row {first}); "
            "they are left out"
        )
    return keep


def _log(table: CsvTable, n: int, keep: NDArray[np.bool_]) -> RobotLog:
    def stack(names: list[str]) -> Floats:
        return np.column_stack([table.columns[name][keep] for name in names])

    return RobotLog(
        t=table.columns["t"][keep],
        theta=stack([f"theta{i + 1}" for i in range(n)]),
        tau=stack([f"tau{i + 1}" for i in range(n)]),
        force=stack(["fx", "fy"]) if "fx" in table.columns else None,
        perturbation=stack(["fdx", "fdy"]) if "fdx" in table.columns else None,
        sync=table.columns["sync"][keep] if "sync" in table.columns else None,
    )


def write_robot_log(log: RobotLog, path: Path) -> None:
    """Write `robot.csv`; reading it back gives the same bits."""
    columns: dict[str, NDArray[np.generic]] = {"t": log.t}
    columns |= {f"theta{i + 1}": log.theta[:, i] for i in range(log.theta.shape[1])}
    columns |= {f"tau{i + 1}": log.tau[:, i] for i in range(log.tau.shape[1])}
    if log.force is not None:
        columns |= {"fx": log.force[:, 0], "fy": log.force[:, 1]}
    if log.perturbation is not None:
        columns |= {"fdx": log.perturbation[:, 0], "fdy": log.perturbation[:, 1]}
    if log.sync is not None:
        columns["sync"] = log.sync
    write_columns(path, columns)
