"""Who was measured, which side, when and how, as every JSON of a study carries it."""

from typing import Any

from impid_host.study.model import Session, Study

Json = dict[str, Any]


def sessions_json(study: Study) -> Json:
    """The key `sessions`: by trial, subject, side, date and posture, null where nobody said."""
    return {"sessions": {trial.name: _session(study.session_of(trial)) for trial in study.trials}}


def _session(session: Session) -> Json:
    date = None if session.date is None else session.date.isoformat()
    return {"subject": session.subject, "side": session.side, "date": date, "posture": session.posture}
