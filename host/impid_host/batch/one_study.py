"""One study on a worker: checked, fitted and, where asked for, diagnosed."""

import platform
import time
from dataclasses import astuple, replace
from importlib.metadata import version
from pathlib import Path

from impid_host.batch.look import broken
from impid_host.batch.task import Answer, BatchOptions
from impid_host.diagnosis.verdict import beside_checks
from impid_host.report.page.findings import Findings, gather
from impid_host.sessions.long_table import common_session, rows_of, session_texts
from impid_host.study.folder import read_study
from impid_host.study.model import Study
from impid_host.study.notices import notices_as_lines

_PACKAGES = ("impid", "numpy", "scipy")


def worked_out(first: Answer, folder: Path, options: BatchOptions) -> Answer:
    """What was found out about it. Nothing is raised: what goes wrong is an answer with reason and remedy."""
    begin = time.monotonic()
    lines: list[str] = []
    try:
        with notices_as_lines(lines.append):
            study = read_study(folder)
            found = gather(study, diagnosed=options.diagnose, terms=options.terms)
        answer = _found_out(first, study, found, options)
    except Exception as error:  # whatever it is, it is this study's, and the others go on
        answer = broken(first, error)
    spent = time.monotonic() - begin
    # Of a copy on this disk, too, the original is named.
    why, *notices = (
        line.removeprefix("warning: ").replace(str(folder), first.place) for line in (answer.why, *lines)
    )
    return replace(
        answer, why=why, notices=tuple(notices), versions=versions(), seconds=spent, worker=platform.node()
    )


def _found_out(first: Answer, study: Study, found: Findings, options: BatchOptions) -> Answer:
    rows = rows_of(study, found.fit, found.diagnosis, trusted=found.trusted)
    whole = common_session(study, [trial.name for trial in study.trials])
    open_parts = [] if found.fit is None else [f"{own.load}: {own.reason}" for own in found.fit.partial]
    missing = found.missing if options.diagnose or found.fit is None else ()
    stages = () if found.diagnosis is None else found.diagnosis.stages
    return replace(
        first,
        status="fitted" if found.fit is not None else "undetermined",
        rows=tuple(astuple(row) for row in rows),
        session=session_texts(whole),
        trusted=found.trusted,
        verdict=found.verdict if missing or options.diagnose else beside_checks("fitted", found.checks),
        checks=tuple(
            {"what": own.what, "where": own.where, "verdict": own.verdict, "words": own.words}
            for own in found.checks
        ),
        effects=tuple(stage.added.label for stage in stages if stage.added is not None),
        why="; ".join([*missing, *open_parts]),
    )


def versions() -> dict[str, str]:
    """Of Python and of the packages that make the numbers."""
    return {"python": platform.python_version(), **{name: version(name) for name in _PACKAGES}}
