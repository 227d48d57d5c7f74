"""Where a report's numbers come from: versions, the board, hashes of the data, the command."""

import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from impid_host.recording.export.origin import board_words, read_origin
from impid_host.report.page.findings import Findings
from impid_host.study.hashes import file_hashes
from impid_host.study.model import Session, Study

_PACKAGES = ("impid", "numpy", "scipy")


def provenance(
    findings: Findings, command: Sequence[str], now: datetime | None = None
) -> list[tuple[str, str]]:
    """Rows of what and which.

    Args:
        command: the command line that made the report.
        now: by default this moment.
    """
    study = findings.study
    made = (now or datetime.now(UTC)).astimezone().isoformat(timespec="seconds")
    rows = [
        ("made", made),
        ("command", " ".join(command)),
        ("versions", ", ".join(f"{name} {version(name)}" for name in _PACKAGES)),
        ("on", f"Python {platform.python_version()}, {platform.system()} {platform.machine()}"),
        ("study", str(study.source.resolve()) if study.source is not None else study.name),
        ("sessions", sessions(study) or "not said ([session] in setup.toml)"),
        ("board", boards(study)),
    ]
    if findings.fit is not None:
        cutoff = findings.fit.cutoff_hz
        low_pass = "" if cutoff is None else f", low-pass at {cutoff:.3g} Hz"
        rows.append(("signal chain", f"{findings.fit.chain}{low_pass}"))
    if study.source is not None:
        rows += [(f"sha256 of {name}", digest) for name, digest in file_hashes(study.source).items()]
    return rows


def boards(study: Study) -> str:
    """Every board that recorded a trial, with its firmware's build; says so where no file tells."""
    if study.source is None:
        return "not known"
    places = [Path(study.source) / trial.name for trial in study.trials]
    found = dict.fromkeys(board_words(read_origin(place)) for place in places)
    return "; ".join(words for words in found if words) or "not known: no trial holds a recording.json"


def sessions(study: Study) -> str:
    """Subject, side, date and posture of the study's trials, each combination once; "" where none is said."""
    found = dict.fromkeys(session_words(study.session_of(trial)) for trial in study.trials)
    return "; ".join(words for words in found if words)


def session_words(session: Session) -> str:
    """What is known of one session, in a line."""
    named = {
        "subject": session.subject,
        "side": session.side,
        "date": None if session.date is None else session.date.isoformat(),
        "posture": session.posture,
    }
    return ", ".join(f"{key} {value}" for key, value in named.items() if value is not None)
