"""What `fit` and `diagnose` found, for Python: frozen, and able to print, tabulate, write and show itself."""

import html
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from impid_host.arrays_out import diagnosis_dataset, fit_dataset
from impid_host.checks import Agreement, Checks
from impid_host.checks.pushes import Pushes
from impid_host.diagnosis.result import Diagnosis
from impid_host.diagnosis.verdict import beside_checks
from impid_host.errors import InputError
from impid_host.extras import extra
from impid_host.impedance.campaign import StudyFit
from impid_host.impedance.force import force_series
from impid_host.impedance.identify import RobotFit
from impid_host.report.diagnosis_json import diagnosis_json
from impid_host.report.fit_json import fit_json
from impid_host.report.fit_parts import Besides
from impid_host.report.page.findings import Findings
from impid_host.report.sessions_json import sessions_json
from impid_host.signals.chain import Chain
from impid_host.study.model import Study

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Json = dict[str, Any]
_ROW = ("where", "parameter", "value", "low", "high", "unit")


@dataclass(frozen=True, slots=True)
class Fitted:
    """Robot and loads of a study.

    >>> from impid_host import example_study
    >>> fitted = example_study().fit()
    >>> sorted(fitted.robot)
    ['alpha1', 'alpha2', 'alpha3', 'alpha4', 'alpha5']
    >>> fitted.robot["alpha1"]["unit"]
    'kg*m^2'
    >>> print(fitted.summary().splitlines()[0])  # doctest: +ELLIPSIS
    robot/parameters alpha1: 0.06... ± ... kg*m^2
    >>> fitted.trusted, fitted.loads["spring"]["model"]
    (True, 'mass-spring')
    >>> fitted.to_dict()["format"]
    'impid-fit/1'
    >>> fitted.pushes.found  # nobody pushed
    ()

    Attributes:
        result: the estimates, with their covariances; checks: what to make of them;
        agreement: what was measured twice; chain: the signal chain;
        pushes: stretches unlike the rest of their trial, and the fit without them.
    """

    study: Study
    result: StudyFit
    checks: Checks
    agreement: Agreement
    chain: Chain
    pushes: Pushes = field(default_factory=Pushes)

    @property
    def trusted(self) -> bool:
        """No number is impossible, and no two measurements contradict each other."""
        return self.checks.trusted

    @property
    def robot(self) -> Json:
        """The robot's parameters by name, each with `value`, `ci95` and `unit`."""
        return dict(self.to_dict()["robot"]["parameters"])

    @property
    def loads(self) -> Json:
        """By load and method ("method1": virtual sensor, "method2": physical sensor) M, B, K and x0.

        Matrices are [[xx, xy], [yx, yy]], each with `value`, `ci95` and `unit`.
        """
        return dict(self.to_dict()["loads"])

    def force(self, trial: str) -> "pd.DataFrame":
        """Force of the load on the robot along a whole trial, N, base frame, against time in s.

        Columns Fx, Fy by the virtual sensor; Fx_sd, Fy_sd, their standard deviations by the robot's
        parameters alone; Fx_physical, Fy_physical where the log has them. Rows that a gap or a filter's edge
        touches are left out.

        >>> from impid_host import example_study
        >>> force = example_study().fit().force("spring_01")
        >>> force.columns.tolist()
        ['Fx', 'Fx_sd', 'Fy', 'Fy_sd']
        >>> bool(force.Fx_sd.max() < 0.1 * force.Fx.std())
        True

        Raises:
            InputError: there is no such trial.
            UndeterminedError: fewer joints than axes.
            ImportError: pandas is not installed; names the extra that brings it.
        """
        aligned = {own.name: own for own in self.result.trials}
        if trial not in aligned:
            where = self.study.source or self.study.name
            raise InputError(where, f"has no trial {trial!r}", f"there are {', '.join(aligned)}")
        robot = self.result.robot
        series = force_series(
            aligned[trial], robot.parameters if isinstance(robot, RobotFit) else robot, self.chain
        )
        columns: dict[str, Any] = {}
        for k, axis in enumerate(series.axes):
            if series.virtual is not None and series.sd is not None:
                columns[f"F{axis}"] = series.virtual[series.valid, k]
                columns[f"F{axis}_sd"] = series.sd[series.valid, k]
            if series.physical is not None:
                columns[f"F{axis}_physical"] = series.physical[series.valid, k]
        pd = _pandas()
        return pd.DataFrame(columns, index=pd.Index(series.t[series.valid], name="t"))

    def to_dict(self) -> Json:
        """What `impid-host fit --json` writes, format impid-fit/1."""
        besides = Besides(self.pushes, self.agreement)
        document = fit_json(self.result, besides, checks=self.checks)
        return document | sessions_json(self.study)

    def summary(self) -> str:
        """Parameters with their 95 % intervals, one to a line; what speaks against them comes first."""
        return _lines(self.to_dict(), self.checks)

    def to_pandas(self) -> "pd.DataFrame":
        """One row per number: where, parameter, value, low, high (95 %), unit.

        >>> from impid_host import example_study
        >>> table = example_study().fit().to_pandas().set_index(["where", "parameter"])
        >>> round(float(table.loc[("loads/spring/method1", "M[0][0]"), "value"]), 1)
        0.8
        """
        return frame(_rows(self.to_dict()), _ROW)

    def to_xarray(self) -> "xr.Dataset":
        """M, B, K by load, sensor, row and column, x0 and the robot's alpha, with `_low` and `_high` (95 %).

        `sensor` is "virtual" (Method 1) or "physical" (Method 2); `row` and `column` the base frame's axes;
        a variable's unit is its attribute `units`; NaN where a load has no such number.

        >>> from impid_host import example_study
        >>> data = example_study().fit().to_xarray()
        >>> data.K.dims, data.K.units
        (('load', 'sensor', 'row', 'column'), 'N/m')
        >>> round(float(data.K.sel(load="spring", sensor="virtual", row="x", column="x")))
        420

        Raises:
            ImportError: xarray is not installed; names the extra that brings it.
        """
        result: xr.Dataset = fit_dataset(self.to_dict())
        return result

    def _repr_html_(self) -> str:
        from impid_host.report.page.tables import fit_tables  # noqa: PLC0415

        checks = self.checks
        found = Findings(
            self.study, checks, checks, self.agreement, self.result, None, "", pushes=self.pushes
        )
        return _html("", self.checks, fit_tables(found))


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """What the first model lacks, proven on data that took no part.

    >>> from impid_host import example_study
    >>> diagnosed = example_study().diagnose()
    >>> diagnosed.verdict.startswith("nothing is missing")
    True
    >>> diagnosed.effects, diagnosed.trusted
    ([], True)
    >>> print(diagnosed.summary().splitlines()[1])  # doctest: +ELLIPSIS
    alpha[0]: 0.06... ± ...
    >>> diagnosed.to_dict()["format"]
    'impid-diagnosis/1'
    >>> diagnosed.to_pandas().stage.unique().tolist()
    [0]
    >>> data = diagnosed.to_xarray()
    >>> data.K.dims, data.stage.values.tolist()
    (('stage', 'load', 'row', 'column'), ['first model'])
    >>> bool(data.validation_rms.sel(channel="tau1")[0] < 0.01)  # N*m
    True

    Attributes:
        result: stages, what is left, ties, residuals; checks: what to make of them.
    """

    study: Study
    result: Diagnosis
    checks: Checks

    @property
    def trusted(self) -> bool:
        """No number is impossible, and no two measurements contradict each other."""
        return self.checks.trusted

    @property
    def verdict(self) -> str:
        """The opening sentence."""
        return beside_checks(self.result.verdict, self.checks)

    @property
    def effects(self) -> list[str]:
        """Names of what was added to the first model, `name@place`, in the order of the stages."""
        return [stage.added.label for stage in self.result.stages if stage.added is not None]

    def to_dict(self) -> Json:
        """What `impid-host diagnose --json` writes, format impid-diagnosis/1."""
        document = diagnosis_json(self.result, self.checks) | sessions_json(self.study)
        return document | {"verdict": self.verdict}

    def summary(self) -> str:
        """The verdict, then the last stage's parameters with their 95 % intervals."""
        return f"{self.verdict}\n" + _lines(self.to_dict()["stages"][-1]["parameters"], self.checks)

    def to_pandas(self) -> "pd.DataFrame":
        """One row per number of every stage: stage, where, parameter, value, low, high (95 %), unit."""
        rows = [
            {"stage": number, **row}
            for number, stage in enumerate(self.to_dict()["stages"])
            for row in _rows(stage["parameters"])
        ]
        return frame(rows, ("stage", *_ROW))

    def to_xarray(self) -> "xr.Dataset":
        """M, B, K and x0 by stage and load, as `Fitted.to_xarray`, alpha by stage, and errors by channel.

        `validation_rms` (stage, channel) is the error on data that took no part, N*m for tau and N for f and
        fs, beside `noise_floor` (channel); the coordinate `stage` names what each stage added.

        Raises:
            ImportError: xarray is not installed; names the extra that brings it.
        """
        result: xr.Dataset = diagnosis_dataset(self.to_dict())
        return result

    def _repr_html_(self) -> str:
        from impid_host.report.page.tables import diagnosis_tables, effects  # noqa: PLC0415

        found = Findings(self.study, self.checks, self.checks, None, None, self.result, self.verdict)
        return _html(self.verdict, self.checks, [*effects(found), *diagnosis_tables(found)])


def _html(verdict: str, checks: Checks, parts: Sequence[Any]) -> str:
    """For a notebook: the verdict, what speaks against the numbers, the tables."""
    from impid_host.report.page.write import tables_html  # noqa: PLC0415  (jinja2 is slow to import)

    words = [verdict] if verdict else []
    words += [f"{own.verdict.upper()}: {own.words}" for own in checks]
    return "".join(f"<p>{html.escape(line)}</p>" for line in words) + tables_html(parts)


def _rows(document: Mapping[str, Any], where: str = "") -> Iterator[Json]:
    """Every number with an interval below a document, flat."""
    for name, own in document.items():
        if not isinstance(own, Mapping):
            continue
        if "value" in own and "ci95" in own:
            yield from _entries(where, name, own)
        else:
            yield from _rows(own, f"{where}/{name}".strip("/"))


def _entries(where: str, name: str, own: Mapping[str, Any], place: str = "") -> Iterator[Json]:
    value, interval = own["value"], own["ci95"]
    unit = own.get("unit", "")
    if isinstance(value, Mapping):
        for key in value:
            yield from _entries(
                f"{where}/{key}", name, {"value": value[key], "ci95": interval[key], "unit": unit}
            )
    elif isinstance(value, list):
        for k, (part, ends) in enumerate(zip(value, interval, strict=True)):
            yield from _entries(where, name, {"value": part, "ci95": ends, "unit": unit}, f"{place}[{k}]")
    else:
        low, high = interval
        yield dict(zip(_ROW, (where, name + place, value, low, high, unit), strict=True))


def _lines(document: Mapping[str, Any], checks: Checks) -> str:
    words = [f"{own.verdict}: {own.words}" for own in checks]
    for row in _rows(document):
        half = 0.5 * (row["high"] - row["low"])
        words.append(
            f"{row['where']} {row['parameter']}: {row['value']:.5g} ± {half:.2g} {row['unit']}".strip()
        )
    return "\n".join(words)


def frame(rows: Any, columns: tuple[str, ...] | None = None) -> "pd.DataFrame":
    """Rows as a data frame.

    Raises:
        ImportError: pandas is not installed; names the extra that brings it.
    """
    return _pandas().DataFrame(list(rows), columns=None if columns is None else list(columns))


def _pandas() -> Any:
    return extra("pandas", "a data frame")
