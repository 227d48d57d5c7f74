"""The mapping: a TOML file that says how foreign logs become a study (docs/import.md)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from impid_host.errors import InputError
from impid_host.robot.model import ROBOTS
from impid_host.study.csv_table import CsvDialect
from impid_host.study.joints import logged_joints
from impid_host.study.model import RobotModelName, Setup
from impid_host.study.quantities import UnitError, factor_to_si, si_unit
from impid_host.study.robot_log import reference_columns
from impid_host.study.setup_file import FORMAT, setup_from_tables
from impid_host.study.toml_file import Table, load_toml, validate

_PAIRS = (("fx", "fy"), ("fdx", "fdy"), ("acc_x", "acc_y"))
_OPTIONAL = (*(name for pair in _PAIRS for name in pair), "acc_t", "sync")


class _Log(Table):
    format: Literal["auto", "csv", "parquet", "mat", "rosbag", "xdf", "mdf", "c3d"] = "auto"
    delimiter: str = ","
    decimal: Literal[".", ","] = "."
    header: bool = True
    skip_rows: Annotated[int, Field(ge=0)] = 0
    comment: Annotated[str, Field(min_length=1)] | None = None
    rate_hz: Annotated[float, Field(gt=0)] | None = None
    drop_incomplete_rows: bool = False

    @model_validator(mode="after")
    def _readable(self) -> Self:
        if self.delimiter != "whitespace" and (
            len(self.delimiter) != 1 or not self.delimiter.isascii() or self.delimiter in '\r\n"'
        ):
            raise ValueError('delimiter must be one character or "whitespace"')
        if self.delimiter == self.decimal:
            raise ValueError("delimiter and decimal must differ")
        return self


class _Trial(Table):
    file: str | None = None
    name: str | None = None
    start_s: float | None = None
    stop_s: float | None = None
    columns: dict[str, Any] = Field(default_factory=dict)


class _Column(Table):
    column: str | int | None = None
    expression: Annotated[str, Field(min_length=1)] | None = None
    unit: str | None = None
    scale: float = 1.0

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.column is None) == (self.expression is None):
            raise ValueError("give either column or expression")
        if self.scale == 0.0:
            raise ValueError("scale must not be zero: it would make every value zero")
        return self


class _Mapping(Table):
    setup: dict[str, Any]
    log: _Log = Field(default_factory=_Log)
    columns: dict[str, Any]
    trial: Annotated[list[dict[str, Any]], Field(min_length=1)]


@dataclass(frozen=True, slots=True)
class ColumnRule:
    """Where one column of `robot.csv`, or an acceleration, comes from: value = source * factor, in SI units.

    Attributes:
        source: a column's name, or an expression.
        is_expression: which of the two.
        factor: `scale` times the unit's factor to SI.
    """

    source: str
    is_expression: bool
    factor: float


@dataclass(frozen=True, slots=True)
class TrialRule:
    """One trial: which file (a pattern), which rows (s on the log's clock), and `trial.toml` as a table."""

    file: str | None
    name: str | None
    start_s: float | None
    stop_s: float | None
    head: dict[str, Any]
    columns: dict[str, ColumnRule]


@dataclass(frozen=True, slots=True)
class Mapping:
    """A checked mapping; `rate_hz` makes the time where the log has none."""

    path: Path
    setup: Setup
    joints: int
    file_format: str
    dialect: CsvDialect
    rate_hz: float | None
    drop_incomplete_rows: bool
    trials: tuple[TrialRule, ...]


def read_mapping(path: Path) -> Mapping:
    """Read and check a mapping.

    Raises:
        InputError: a key is missing or wrong, a column's unit does not fit it; names the key.
    """
    checked = validate(_Mapping, load_toml(path), path)
    setup = setup_from_tables({"format": FORMAT, **checked.setup}, path, prefix="setup")
    model = setup.robot.model
    joints = _joints(
        model, [*checked.columns, *(name for trial in checked.trial for name in _own_columns(trial))]
    )
    slides = logged_joints(setup.robot, joints, path)
    trials = tuple(
        _trial_rule(
            path, index, table, checked.columns, model=model, slides=slides, timed=checked.log.rate_hz is None
        )
        for index, table in enumerate(checked.trial)
    )
    if setup.accelerometer is None and any("acc_x" in trial.columns for trial in trials):
        raise InputError(
            path,
            "key `setup.accelerometer` is missing",
            "say where acc_x, acc_y are mounted (mount, mount_angle_rad)",
        )
    log = checked.log
    return Mapping(
        path=path,
        setup=setup,
        joints=joints,
        file_format=log.format,
        dialect=CsvDialect(log.delimiter, log.decimal, log.header, log.skip_rows, log.comment),
        rate_hz=log.rate_hz,
        drop_incomplete_rows=log.drop_incomplete_rows,
        trials=trials,
    )


def _own_columns(trial: dict[str, Any]) -> list[str]:
    columns = trial.get("columns")
    return list(columns) if isinstance(columns, dict) else []


def _joints(model: RobotModelName, columns: list[str]) -> int:
    declared = ROBOTS[model].joints
    if declared is not None:
        return declared
    return max((i for i in range(1, 65) if f"theta{i}" in columns), default=1)


def _trial_rule(
    path: Path,
    index: int,
    table: dict[str, Any],
    common: dict[str, Any],
    *,
    model: RobotModelName,
    slides: tuple[bool, ...],
    timed: bool,
) -> TrialRule:
    prefix = f"trial[{index}]"
    own = {name: value for name, value in table.items() if name in _Trial.model_fields}
    head = {name: value for name, value in table.items() if name not in _Trial.model_fields}
    checked = validate(_Trial, own, path, prefix=prefix)
    given = {**common, **checked.columns}
    required = [f"{kind}{i + 1}" for kind in ("theta", "tau") for i in range(len(slides))]
    if timed:
        required.insert(0, "t")
    allowed = ["t", *required, *_OPTIONAL, *reference_columns(len(slides))]
    for name in required:
        if name not in given:
            remedy = "add it" + (" (or give [log] rate_hz)" if name == "t" else "")
            raise InputError(path, f"key `columns.{name}` is missing", remedy)
    for name in given:
        if name not in allowed:
            remedy = f"model {model} has {', '.join(dict.fromkeys(allowed))}"
            raise InputError(path, f"key `columns.{name}` is no column of this study", remedy)
    for pair in _PAIRS:
        present = [name for name in pair if name in given]
        if len(present) == 1:
            raise InputError(
                path, f"key `columns.{present[0]}` stands alone", f"give both {' and '.join(pair)}"
            )
    if "acc_t" in given and "acc_x" not in given:
        raise InputError(path, "key `columns.acc_t` stands alone", "give acc_x and acc_y as well")
    rules = {name: _column_rule(path, name, spec, slides) for name, spec in given.items()}
    return TrialRule(checked.file, checked.name, checked.start_s, checked.stop_s, head, rules)


def _column_rule(path: Path, name: str, spec: object, slides: tuple[bool, ...]) -> ColumnRule:
    table = {"column": spec} if isinstance(spec, str | int) and not isinstance(spec, bool) else spec
    prefix = f"columns.{name}"
    if not isinstance(table, dict):
        raise InputError(
            path, f"key `{prefix}` does not fit", "give a column's name or a table {column = ..., unit = ...}"
        )
    checked = validate(_Column, table, path, prefix=prefix)
    target = si_unit(name, slides)
    try:
        factor = checked.scale * factor_to_si(target if checked.unit is None else checked.unit, target)
    except UnitError as error:
        raise InputError(path, f"key `{prefix}.unit`: {error}", "correct the unit") from None
    if checked.expression is not None:
        return ColumnRule(checked.expression, True, factor)
    return ColumnRule(str(checked.column), False, factor)
