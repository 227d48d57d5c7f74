"""The front door of impid for Python: a study in, a frozen result out, to print, write and tabulate."""

import html
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from impid_host.checks import Checks, agreement, check_study
from impid_host.checks.of_diagnosis import beside_diagnosis
from impid_host.checks.of_fit import gate_fit
from impid_host.diagnosis.diagnose import diagnose as _diagnose
from impid_host.diagnosis.result import Diagnosis
from impid_host.diagnosis.verdict import beside_checks
from impid_host.impedance.campaign import Options, StudyFit, default_chain, fit_study
from impid_host.impedance.rows import Split
from impid_host.report.diagnosis_json import diagnosis_json
from impid_host.report.fit_json import fit_json
from impid_host.study.folder import read_study as _read_study
from impid_host.study.model import Study

if TYPE_CHECKING:
    import pandas as pd

Json = dict[str, Any]
_ROW = ("where", "parameter", "value", "low", "high", "unit")


def read_study(path: str | Path) -> Study:
    """Read a study folder (docs/study-format.md).

    Raises:
        InputError: the folder or a file of it cannot be read; names file, row or key, and the remedy.
    """
    return _read_study(Path(path))


def check(study: Study | str | Path) -> Checks:
    """What the study says about its own input: mistakes of the setup, contradictions, impossible numbers.

    Raises:
        InputError: as `read_study`.
    """
    return check_study(_study(study))


@dataclass(frozen=True, slots=True)
class Fitted:
    """Robot and loads of a study.

    Attributes:
        result: the estimates, with their covariances; checks: what to make of them.
    """

    result: StudyFit
    checks: Checks
    document: Json

    @property
    def trusted(self) -> bool:
        """No number is impossible, and no two measurements contradict each other."""
        return self.checks.trusted

    def to_dict(self) -> Json:
        """What `impid-host fit --json` writes, format impid-fit/1."""
        return self.document

    def summary(self) -> str:
        """Parameters with their 95 % intervals, one to a line."""
        return _lines(self.document, self.checks)

    def to_pandas(self) -> "pd.DataFrame":
        """One row per number: where, parameter, value, low, high (95 %), unit."""
        return _frame(_rows(self.document))

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.summary())}</pre>"


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """What the first model lacks, proven on data that took no part."""

    result: Diagnosis
    checks: Checks
    document: Json

    @property
    def trusted(self) -> bool:
        """No number is impossible, and no two measurements contradict each other."""
        return self.checks.trusted

    @property
    def verdict(self) -> str:
        """The opening sentence."""
        return str(self.document["verdict"])

    def to_dict(self) -> Json:
        """What `impid-host diagnose --json` writes, format impid-diagnosis/1."""
        return self.document

    def summary(self) -> str:
        """The verdict, then the last stage's parameters with their 95 % intervals."""
        return f"{self.verdict}\n" + _lines(self.document["stages"][-1]["parameters"], self.checks)

    def to_pandas(self) -> "pd.DataFrame":
        """One row per number of every stage: stage, where, parameter, value, low, high (95 %), unit."""
        rows = [
            {"stage": number, **row}
            for number, stage in enumerate(self.document["stages"])
            for row in _rows(stage["parameters"])
        ]
        return _frame(rows, ("stage", *_ROW))

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.summary())}</pre>"


def fit(study: Study | str | Path, *, with_terms: tuple[str, ...] = (), validate_s: float = 10.0) -> Fitted:
    """Identify the robot, then every load, with 95 % intervals ([D] Sec. III).

    Args:
        with_terms: optional terms of the robot model by name, as `fit --with`.
        validate_s: seconds at the end of each trial that are held out.

    Raises:
        InputError: as `read_study`.
        UndeterminedError: the data do not determine what was asked.
    """
    own = _study(study)
    result = fit_study(own, Options(chain=default_chain(own), terms=with_terms, split=Split(validate_s)))
    twice = agreement(own, result.loads)
    checks = check_study(own).with_more(gate_fit(result)).with_more(twice.checks)
    document = fit_json(
        result.study,
        result.chain,
        result.trials,
        result.robot,
        result.loads,
        spectral=result.spectral,
        partial=result.partial,
        checks=checks,
        measured_twice=twice,
    )
    return Fitted(result, checks, document)


def diagnose(study: Study | str | Path, *, cutoff_hz: float | None = None) -> Diagnosed:
    """Find what the first model lacks, add it, judge it on data that took no part.

    Args:
        cutoff_hz: of the band in which errors are told; None: by the motion, as `fit`.

    Raises:
        InputError: as `read_study`.
        UndeterminedError: the data do not determine the robot or a load.
    """
    own = _study(study)
    answer = _diagnose(own, cutoff_hz=cutoff_hz)
    checks = beside_diagnosis(own, answer, check_study(own))
    document = diagnosis_json(answer, checks)
    document["verdict"] = beside_checks(answer.verdict, checks)
    return Diagnosed(answer, checks, document)


def _study(study: Study | str | Path) -> Study:
    return study if isinstance(study, Study) else read_study(study)


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


def _frame(rows: Any, columns: tuple[str, ...] = _ROW) -> "pd.DataFrame":
    try:
        import pandas as pd  # noqa: PLC0415  (an optional extra)
    except ImportError:
        raise ImportError("to_pandas needs pandas: pip install 'impid[pandas]'") from None
    return pd.DataFrame(list(rows), columns=list(columns))
