"""Any number of studies as one long table: a row for each number, with who, which side, when and how."""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from impid_host.diagnosis.result import Diagnosis
from impid_host.errors import InputError
from impid_host.impedance.campaign import StudyFit
from impid_host.impedance.identify import LoadFit, RobotFit
from impid_host.report.diagnosis_tables import entries_of
from impid_host.report.parameter_entries import parameter_entries
from impid_host.sessions.row import Row
from impid_host.study.model import Session, Study

METHODS = {"virtual sensor": "method1", "physical sensor": "method2"}
NOISE = "noise"


def rows_of(study: Study, fit: StudyFit | None, diagnosis: Diagnosis | None, *, trusted: bool) -> list[Row]:
    """Every number of a study's fit, and of its diagnosis' last model."""
    rows = [] if fit is None else list(_of_fit(study, fit, trusted))
    return rows + ([] if diagnosis is None else list(_of_diagnosis(study, diagnosis, trusted)))


def common_session(study: Study, trials: Iterable[str]) -> Session:
    """What the named trials have in common; None where they differ."""
    wanted = set(trials)
    found = [study.session_of(trial) for trial in study.trials if trial.name in wanted]
    agreed: dict[str, Any] = {}
    for each in fields(Session):
        values = {getattr(session, each.name) for session in found}
        agreed[each.name] = values.pop() if len(values) == 1 else None
    return Session(**agreed)


def _of_fit(study: Study, fit: StudyFit, trusted: bool) -> Iterator[Row]:
    if isinstance(fit.robot, RobotFit):
        own = fit.robot.estimate
        session = common_session(study, [part.trial for part in fit.robot.series])
        for name, unit, value, ci, sd in zip(own.names, own.units, own.value, own.ci95, own.sd, strict=True):
            numbers = (float(value), float(ci[0]), float(ci[1]), float(sd))
            yield _row(study, session, "", "free trials", name, numbers, unit, trusted)
    for load in fit.loads:
        yield from _of_load(study, load, trusted)


def _of_load(study: Study, load: LoadFit, trusted: bool) -> Iterator[Row]:
    session = common_session(study, [part.trial for part in load.series])
    for entry in parameter_entries(load):
        value, ci = entry.of(load)
        sd = float(getattr(load, entry.quantity).sd[entry.index]) * entry.scale
        numbers = (value, float(ci[0]), float(ci[1]), sd)
        yield _row(study, session, load.load, METHODS[load.method], entry.label, numbers, entry.unit, trusted)


def _of_diagnosis(study: Study, diagnosis: Diagnosis, trusted: bool) -> Iterator[Row]:
    trials = {trial.name: trial.load if trial.kind != "free" else "" for trial in study.trials}
    for entry in entries_of(diagnosis.stages[-1]):
        session = common_session(study, [name for name, load in trials.items() if load == entry.load])
        noise = entry.parts.get(NOISE, entry.half)
        numbers = (entry.value, entry.value - entry.half, entry.value + entry.half, noise / 1.96)
        name = (entry.letter.lower() if entry.load else entry.letter) + entry.axes
        yield _row(study, session, entry.load, "diagnose", name, numbers, entry.unit, trusted)


def _row(
    study: Study,
    session: Session,
    load: str,
    method: str,
    quantity: str,
    numbers: tuple[float, float, float, float],
    unit: str,
    trusted: bool,
) -> Row:
    return Row(study.name, *session_texts(session), load, method, quantity, *numbers, unit, trusted)


def session_texts(session: Session) -> tuple[str, str, str, str]:
    """Subject, side, date (YYYY-MM-DD) and posture, "" where nobody said."""
    date = "" if session.date is None else session.date.isoformat()
    return session.subject or "", session.side or "", date, session.posture or ""


def write_table(rows: Sequence[Row], path: Path) -> None:
    """Write the rows as CSV, or as Parquet where the file ends in .parquet.

    Raises:
        InputError: another ending, or the file cannot be written.
    """
    ending = path.suffix.lower()
    if ending not in (".csv", ".parquet"):
        raise InputError(path, f"ends in {ending or 'nothing'}", "name it .csv or .parquet")
    try:
        path.write_bytes(_csv(rows) if ending == ".csv" else _parquet(rows))
    except OSError as error:
        raise InputError(path, f"cannot be written ({error.strerror})", "choose another place") from None


def _csv(rows: Sequence[Row]) -> bytes:
    text = io.StringIO()
    table = csv.DictWriter(text, [each.name for each in fields(Row)], lineterminator="\n")
    table.writeheader()
    table.writerows({**asdict(row), "trusted": int(row.trusted)} for row in rows)
    return text.getvalue().encode()


def _parquet(rows: Sequence[Row]) -> bytes:
    import pyarrow as pa  # noqa: PLC0415  (slow to import)
    from pyarrow import parquet  # noqa: PLC0415

    columns = {each.name: [getattr(row, each.name) for row in rows] for each in fields(Row)}
    sink = pa.BufferOutputStream()
    parquet.write_table(pa.table(columns), sink)
    return bytes(sink.getvalue())
