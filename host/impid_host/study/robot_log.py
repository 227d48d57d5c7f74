"""From named columns to a `RobotLog`: what every log has to satisfy, whatever file it came from."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from impid_host.errors import InputError
from impid_host.study.model import Floats, RobotLog
from impid_host.study.notices import notice
from impid_host.study.stamps import clock_jump, recovered, words

FORCE_PAIRS = (("fx", "fy"), ("fdx", "fdy"))
# No arm, spring or laboratory robot gets near these; a larger value is a wrong unit or a broken cell.
LIMIT = {"t": 1e11, "theta": 1e5, "tau": 1e6, "f": 1e6}


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


def reference_columns(joints: int) -> list[str]:
    """The columns of what the controller was told to follow; a log has all of them or none."""
    return [f"theta{i + 1}_ref" for i in range(joints)]


def robot_log(table: LogTable, joints: int, also: Sequence[str] = ()) -> RobotLog:
    """The log that `table` holds, with strictly increasing `t`.

    Stamps in bursts or of a coarse clock are put back on the rows' own clock, with a warning. Else a row that
    repeats its predecessor's stamp is left out, with a warning; values are never altered.

    Raises:
        InputError: half a force, an absurd magnitude, time going backwards or jumping; names the row.
    """
    for pair in FORCE_PAIRS:
        present = [name for name in pair if name in table.columns]
        if len(present) == 1:
            missing = next(name for name in pair if name not in present)
            raise InputError(table.path, f"has column {present[0]} but no {missing}", "add or remove it")
    references = [name for name in reference_columns(joints) if name in table.columns]
    if references and len(references) < joints:
        missing = next(name for name in reference_columns(joints) if name not in references)
        raise InputError(table.path, f"has column {references[0]} but no {missing}", "add or remove it")
    _check_values(table, joints)
    _refuse_backwards(table)
    columns = dict(table.columns)
    theta = np.column_stack([columns[f"theta{i + 1}"] for i in range(joints)])
    _refuse_jump(table, theta)
    again = recovered(columns["t"], theta)
    if again is None:
        return _log(columns, joints, _increasing(table), also)
    t, stamps = again
    notice(f"{table.path}: {words(stamps)}")
    log = _log(columns | {"t": t}, joints, np.ones(len(t), dtype=bool), also)
    return replace(log, stamps=stamps, t_written=columns["t"])


def _check_values(table: LogTable, joints: int) -> None:
    known = {
        *log_columns(joints),
        *reference_columns(joints),
        "sync",
        *(name for pair in FORCE_PAIRS for name in pair),
    }
    for name, column in table.columns.items():
        if name not in known:
            continue
        if name == "sync":
            wrong = column > 1
            what = "a level other than 0 and 1"
        else:
            limit = LIMIT[next(kind for kind in ("theta", "tau", "t", "f") if name.startswith(kind))]
            with np.errstate(invalid="ignore"):
                wrong = np.abs(column) > limit
            what = f"a magnitude above {limit:.0e}, which nothing measured has"
        if wrong.any():
            index = int(np.argmax(wrong))
            remedy = "check the unit or the value"
            raise InputError(table.path, f"column {name} holds {what}", remedy, row=table.row(index))


def _refuse_backwards(table: LogTable) -> None:
    t = table.columns["t"]
    step = np.diff(t)
    if (step < 0).any():
        index = int(np.argmax(step < 0)) + 1
        what = f"t goes backwards, from {t[index - 1]} s to {t[index]} s"
        remedy = "sort the rows by t, or put what follows a restart into a trial of its own"
        raise InputError(
            table.path,
            what,
            remedy,
            row=table.row(index),
            check="time.jump",
            evidence={"jump_s": float(step[index - 1])},
        )


def _refuse_jump(table: LogTable, theta: Floats) -> None:
    t = table.columns["t"]
    jump = clock_jump(t, theta)
    if jump is None:
        return
    what = f"t jumps by {jump.jump_s:.6g} s, from {t[jump.row - 1]} s to {t[jump.row]} s, "
    if jump.motion_goes_on:
        what += "while the joints go on as if no time had passed"
        remedy = f"take {jump.jump_s:.6g} s off all later stamps if the clock was set, or cut the log there"
    else:
        what += "which is longer than all that is recorded"
        remedy = "put what follows into a trial of its own"
    row = table.row(jump.row)
    raise InputError(table.path, what, remedy, row=row, check="time.jump", evidence={"jump_s": jump.jump_s})


def _increasing(table: LogTable) -> NDArray[np.bool_]:
    """Which rows to keep so that `t` increases strictly, shape (N,)."""
    step = np.diff(table.columns["t"])
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


def _log(
    columns: Mapping[str, NDArray[Any]], n: int, keep: NDArray[np.bool_], also: Sequence[str]
) -> RobotLog:
    def stack(names: list[str]) -> Floats:
        return np.column_stack([columns[name][keep] for name in names])

    return RobotLog(
        t=columns["t"][keep],
        theta=stack([f"theta{i + 1}" for i in range(n)]),
        tau=stack([f"tau{i + 1}" for i in range(n)]),
        force=stack(["fx", "fy"]) if "fx" in columns else None,
        perturbation=stack(["fdx", "fdy"]) if "fdx" in columns else None,
        sync=columns["sync"][keep] if "sync" in columns else None,
        columns={name: np.asarray(columns[name][keep], dtype=np.float64) for name in also},
        reference=stack(reference_columns(n)) if "theta1_ref" in columns else None,
    )
