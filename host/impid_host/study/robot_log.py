"""From named columns to a `RobotLog`: what every log has to satisfy, whatever file it came from."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from impid_host.errors import InputError
from impid_host.study.model import Floats, RobotLog
from impid_host.study.notices import notice

FORCE_PAIRS = (("fx", "fy"), ("fdx", "fdy"))
# No arm, spring or laboratory robot gets near these; a larger value is a wrong unit or a broken cell.
_LIMIT = {"t": 1e11, "theta": 1e5, "tau": 1e6, "f": 1e6}


class LogTable(Protocol):
    """Columns named as in `robot.csv`, each of shape (N,), SI units, and where they came from."""

    @property
    def path(self) -> Path: ...

    @property
    def columns(self) -> Mapping[str, NDArray[Any]]: ...

    def row(self, index: int) -> int:
        """The row of the file that holds data row `index`."""
        ...


def log_columns(joints: int) -> list[str]:
    """The columns that every log of a robot with so many joints must have."""
    return ["t", *(f"theta{i + 1}" for i in range(joints)), *(f"tau{i + 1}" for i in range(joints))]


def robot_log(table: LogTable, joints: int) -> RobotLog:
    """The log that `table` holds, with strictly increasing `t`.

    A row that repeats its predecessor's stamp is left out with a warning; values are never altered.

    Raises:
        InputError: half a force, an absurd magnitude, or time going backwards; names the row.
    """
    for pair in FORCE_PAIRS:
        present = [name for name in pair if name in table.columns]
        if len(present) == 1:
            missing = next(name for name in pair if name not in present)
            raise InputError(table.path, f"has column {present[0]} but no {missing}", "add or remove it")
    _check_values(table)
    return _log(table, joints, _increasing(table))


def _check_values(table: LogTable) -> None:
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


def _increasing(table: LogTable) -> NDArray[np.bool_]:
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


def _log(table: LogTable, n: int, keep: NDArray[np.bool_]) -> RobotLog:
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
