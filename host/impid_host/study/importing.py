"""Foreign logs into a study: each trial of the mapping picks a log, its columns, and its rows."""

import re
from collections.abc import Mapping as Columns
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from impid_host.errors import InputError
from impid_host.samples import ForeignSamples
from impid_host.study.expressions import ExpressionError, evaluate
from impid_host.study.foreign_log import ForeignLog, open_log
from impid_host.study.mapping import ColumnRule, Mapping, TrialRule, read_mapping
from impid_host.study.model import Floats, RobotLog, Study, Trial
from impid_host.study.notices import notice
from impid_host.study.robot_log import LIMIT, robot_log
from impid_host.study.trial_file import TrialHead, head_from_table

_APART = ("acc_t", "acc_x", "acc_y")
_MAY_BE_NAN = ("fx", "fy", "fdx", "fdy")


@dataclass(frozen=True, slots=True)
class _Picked:
    """Columns of `robot.csv` taken from a log; `kept` holds the index of each row in the log, shape (N,)."""

    log: ForeignLog
    columns: Columns[str, NDArray[np.generic]]
    kept: NDArray[np.intp]

    @property
    def path(self) -> Path:
        return self.log.path

    def row(self, index: int) -> int:
        return self.log.row(int(self.kept[index]))


def import_logs(logs: Sequence[Path], mapping_path: Path, name: str) -> Study:
    """The study that the mapping makes of the logs.

    Values are taken as they are, times unit and scale; nothing is resampled or filtered.

    Raises:
        InputError: mapping or log cannot be used as it is; names file, key or row, and remedy.
    """
    mapping = read_mapping(mapping_path)
    trials: dict[str, Trial] = {}
    opened: dict[Path, ForeignLog] = {}
    for index, rule in enumerate(mapping.trials):
        for log in _logs_of(rule, logs, mapping.path, index):
            if log not in opened:
                opened[log] = open_log(log, mapping.file_format, mapping.dialect)
            trial = _import_trial(opened[log], rule, mapping, index)
            if trial.name in trials:
                remedy = "give each [[trial]] its own name"
                raise InputError(mapping.path, f"two trials are called {trial.name}", remedy)
            trials[trial.name] = trial
    for log in logs:
        if log not in opened:
            notice(f"{log}: no [[trial]] of {mapping.path} takes this file; it was not imported")
    return Study(name=name, setup=mapping.setup, trials=tuple(trials[key] for key in sorted(trials)))


@dataclass(frozen=True, slots=True)
class MappedLog:
    """A robot's log read by a mapping, and what its [[trial]] says of the trial."""

    robot: RobotLog
    head: TrialHead


def read_mapped_log(path: Path, mapping: Mapping, trial_name: str) -> MappedLog:
    """One robot's log as the mapping has it; of several [[trial]] that take the file, the one of this name.

    Raises:
        InputError: no [[trial]] takes this file, or several do, or the log cannot be used.
    """
    taking = [
        (index, rule)
        for index, rule in enumerate(mapping.trials)
        if rule.file is None or fnmatchcase(path.name, rule.file)
    ]
    named = [(index, rule) for index, rule in taking if rule.name == trial_name]
    chosen = named if len(taking) > 1 else taking
    if len(chosen) != 1:
        found = "no [[trial]] takes" if not taking else f"{len(taking)} [[trial]] take"
        remedy = f'let one take it by file = "{path.name}"' + (
            f' and name = "{trial_name}"' if taking else ""
        )
        raise InputError(mapping.path, f"{found} {path.name}", remedy)
    index, rule = chosen[0]
    head = head_from_table(rule.head, mapping.path, trial_name, prefix=f"trial[{index}]")
    robot, _ = _logs(open_log(path, mapping.file_format, mapping.dialect), rule, mapping)
    return MappedLog(robot, head)


def _logs_of(rule: TrialRule, logs: Sequence[Path], mapping_path: Path, index: int) -> list[Path]:
    if rule.file is None:
        if len(logs) == 1:
            return [logs[0]]
        remedy = 'say which of the logs it takes: file = "name.csv" or a pattern such as "*.csv"'
        raise InputError(mapping_path, f"key `trial[{index}].file` is missing", remedy)
    matching = [log for log in logs if fnmatchcase(log.name, rule.file)]
    if not matching:
        given = ", ".join(log.name for log in logs[:10])
        raise InputError(
            mapping_path, f"trial[{index}] takes {rule.file}, but the logs given are {given}", "add it"
        )
    return matching


def _import_trial(log: ForeignLog, rule: TrialRule, mapping: Mapping, index: int) -> Trial:
    stem = re.sub(r"[^A-Za-z0-9_.+-]+", "_", log.path.stem).lstrip(".")
    name = (rule.name or "{stem}").replace("{stem}", stem)
    if not name or Path(name).name != name or "\0" in name or name.startswith("."):
        raise InputError(
            mapping.path, f"trial[{index}]: {name!r} cannot name a folder", "use a name such as free_01"
        )
    head = head_from_table(rule.head, mapping.path, name, prefix=f"trial[{index}]")
    robot, device = _logs(log, rule, mapping)
    return Trial(
        name=name,
        kind=head.kind,
        load=head.load,
        robot=robot,
        device=device,
        on=head.on,
        payload_kg=head.payload_kg,
        note=head.note,
        session=head.session,
    )


def _logs(log: ForeignLog, rule: TrialRule, mapping: Mapping) -> tuple[RobotLog, ForeignSamples | None]:
    """The robot's log, and the accelerations that stand beside it, on the same clock."""
    values = {name: _values(log, name, column, mapping.path) for name, column in rule.columns.items()}
    apart = {name: values.pop(name) for name in _APART} if "acc_t" in values else {}
    length = _common_length(log, values, rule)
    if mapping.rate_hz is not None and "t" not in values:
        values["t"] = np.arange(length) / mapping.rate_hz
    columns = {name: np.broadcast_to(column, (length,)) for name, column in values.items()}
    kept = _rows_in_range(log, columns["t"], rule)
    kept = kept[_complete(log, columns, kept, drop=mapping.drop_incomplete_rows)]
    picked: dict[str, NDArray[np.generic]] = {name: column[kept] for name, column in columns.items()}
    if "sync" in picked:
        picked["sync"] = _levels(log, columns["sync"], kept)
    felt = [picked.pop(name) for name in ("acc_x", "acc_y") if name in picked]
    robot = robot_log(_Picked(log, picked, kept), mapping.joints)
    if apart:
        return _beside(robot, *_apart(log, apart, rule, mapping))
    if not felt:
        return robot, None
    t = picked["t"] if robot.t_written is None else robot.t
    return _beside(robot, np.asarray(t, dtype=np.float64), np.stack(felt, axis=1).astype(np.float64))


def _apart(
    log: ForeignLog, values: Columns[str, Floats], rule: TrialRule, mapping: Mapping
) -> tuple[Floats, Floats]:
    """Accelerations that have rows of their own: times (N,), and along the sensor's axes, (N, 2)."""
    length = _common_length(log, values, rule)
    columns = {name: np.broadcast_to(column, (length,)) for name, column in values.items()}
    kept = _rows_in_range(log, columns["acc_t"], rule)
    kept = kept[_complete(log, columns, kept, drop=mapping.drop_incomplete_rows)]
    t, *felt = (columns[name][kept] for name in _APART)
    return t, np.stack(felt, axis=1)


def _beside(robot: RobotLog, t: Floats, acceleration: Floats) -> tuple[RobotLog, ForeignSamples]:
    """Accelerations (N, 2) at the log's times (N,) as those of a module that shares its clock.

    A module's stamps are whole microseconds from its start, so a clock that begins below zero is shifted.
    """
    rows = np.concatenate(([True], np.diff(t) > 0))
    early = min(0.0, float(np.floor(robot.t[0])))
    if early < 0.0:
        written = None if robot.t_written is None else robot.t_written - early
        robot = replace(robot, t=robot.t - early, t_written=written)
    count = int(rows.sum())
    return robot, ForeignSamples(
        t_us=np.round((t[rows] - early) * 1e6).astype(np.uint64),
        seq=np.arange(count, dtype=np.uint32),
        flags=np.zeros(count, dtype=np.uint8),
        acceleration=acceleration[rows],
    )


def _values(log: ForeignLog, name: str, rule: ColumnRule, mapping_path: Path) -> Floats:
    def column(source: str) -> Floats:
        if source not in log.names():
            there = log.names()
            remedy = log.hint() or "correct the name in the mapping"
            shown = ", ".join(there[:40]) + (", ..." if len(there) > 40 else "")
            what = (
                f"has no column {source}, which {mapping_path} names for {name} (it has: {shown or 'none'})"
            )
            raise InputError(log.path, what, remedy)
        return log.column(source)

    if not rule.is_expression:
        return column(rule.source) * rule.factor
    try:
        return evaluate(rule.source, column) * rule.factor
    except ExpressionError as error:
        what = f"key `columns.{name}.expression`: {rule.source[:80]!r} {error}"
        raise InputError(
            mapping_path, what, "correct the expression (docs/import.md lists what it may use)"
        ) from None


def _common_length(log: ForeignLog, values: Columns[str, Floats], rule: TrialRule) -> int:
    """How many rows the columns have.

    Raises:
        InputError: no rows, or columns of different length.
    """
    lengths = {name: len(column) for name, column in values.items() if column.ndim == 1}
    if not lengths or min(lengths.values()) == 0:
        raise InputError(log.path, "has no rows", "the log was never filled; record it again")
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{name} ({rule.columns[name].source}) {length}" for name, length in lengths.items())
        raise InputError(log.path, f"has columns of different length: {told}", "map columns of one recording")
    return next(iter(lengths.values()))


def _rows_in_range(log: ForeignLog, t: Floats, rule: TrialRule) -> NDArray[np.intp]:
    """Indices of the rows with start_s <= t < stop_s; all of them where no range is given, shape (N,)."""
    if rule.start_s is None and rule.stop_s is None:
        return np.arange(len(t))
    start = -np.inf if rule.start_s is None else rule.start_s
    stop = np.inf if rule.stop_s is None else rule.stop_s
    # What no clock shows is garbage, as before the first sample or after the last.
    kept = np.flatnonzero((t >= start) & (t < stop) & (np.abs(t) < LIMIT["t"]))
    if len(kept) == 0:
        covers = f"it covers {np.nanmin(t):g} s to {np.nanmax(t):g} s"
        what = f"has no rows between {start:g} s and {stop:g} s; {covers}"
        raise InputError(log.path, what, "correct start_s and stop_s")
    between = np.arange(kept[0], kept[-1] + 1)
    # A row whose time cannot be read lies in the range where its neighbours do, and is looked at like them.
    return np.union1d(kept, between[np.isnan(t[between])])


def _complete(
    log: ForeignLog, columns: Columns[str, Floats], kept: NDArray[np.intp], *, drop: bool
) -> NDArray[np.bool_]:
    """Which of the kept rows have a number in every column that needs one, shape (N,).

    Raises:
        InputError: a row has none and rows may not be dropped.
    """
    broken = log.broken()
    complete = np.ones(len(kept), dtype=bool)
    if broken:
        complete = ~np.isin(kept, np.fromiter(broken, dtype=np.intp))
        if not complete.all() and not drop:
            raise broken[int(kept[int(np.argmin(complete))])]
    for name, column in columns.items():
        if name in _MAY_BE_NAN:
            continue
        bad = np.isnan(column[kept])
        if bad.any() and not drop:
            row = log.row(int(kept[int(np.argmax(bad))]))
            what = f"{name} is empty or NaN in {int(bad.sum())} rows, first"
            remedy = "set drop_incomplete_rows = true in [log], or limit the trial with start_s and stop_s"
            raise InputError(log.path, what, remedy, row=row)
        complete &= ~bad
    if not complete.any():
        raise InputError(log.path, "has no complete row", "check which columns the mapping takes")
    if not complete.all():
        notice(f"{log.path}: {int((~complete).sum())} incomplete rows left out")
    return complete


def _levels(log: ForeignLog, column: Floats, kept: NDArray[np.intp]) -> NDArray[np.uint8]:
    wrong = (column[kept] != 0.0) & (column[kept] != 1.0)
    if wrong.any():
        row = log.row(int(kept[int(np.argmax(wrong))]))
        raise InputError(
            log.path, "sync is neither 0 nor 1", 'use an expression such as "sync_V > 1.5"', row=row
        )
    return column[kept].astype(np.uint8)
