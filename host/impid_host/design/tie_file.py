"""What a diagnosis left open, read from its JSON."""

import json
from dataclasses import dataclass
from pathlib import Path

from impid_host.effects.effect import UNATTRIBUTED
from impid_host.errors import InputError
from impid_host.study.toml_file import Table, validate

FORMAT = "impid-diagnosis/1"


class _Added(Table):
    effect: str
    where: str | list[str]
    when: str | list[str] = "all"


class _Stage(Table):
    added: _Added | None = None


class _Tie(Table):
    candidates: list[str]


class _File(Table):
    study: str
    cutoff_Hz: float | None = None
    stages: list[_Stage]
    ambiguous: list[_Tie]


@dataclass(frozen=True, slots=True)
class Named:
    """An effect that the diagnosis added: its name, its places, and in which trials."""

    effect: str
    where: tuple[str, ...]
    when: str


@dataclass(frozen=True, slots=True)
class OpenQuestions:
    """The ties of a diagnosis, each by its candidates' labels, and what it named for certain.

    Attributes:
        cutoff_hz: of the band in which it looked; None: as by default.
    """

    path: Path
    study: str
    cutoff_hz: float | None
    ties: tuple[tuple[str, ...], ...]
    named: tuple[Named, ...]


def read_ties(path: Path) -> OpenQuestions:
    """Read what `diagnose --json` wrote.

    Raises:
        InputError: the file is missing, is no diagnosis, or leaves nothing open.
    """
    remedy = "make it with `impid-host diagnose STUDY --json diagnosis.json`"
    try:
        data = json.loads(path.read_bytes())
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", remedy) from None
    except (ValueError, RecursionError) as error:
        raise InputError(path, f"is no diagnosis ({str(error)[:80]})", remedy) from None
    written = data.get("format") if isinstance(data, dict) else None
    if written != FORMAT:
        raise InputError(path, f"has format {written!r}, not {FORMAT!r}", remedy)
    file = validate(_File, {key: data[key] for key in _File.model_fields if key in data}, path)
    ties = tuple(tuple(tie.candidates) for tie in file.ambiguous if tie.candidates)
    if not ties:
        raise InputError(
            path, "leaves nothing open (`ambiguous` is empty)", "there is no tie to design a trial for"
        )
    found = [stage.added for stage in file.stages if stage.added is not None]
    named = [
        Named(
            own.effect,
            (own.where,) if isinstance(own.where, str) else tuple(own.where),
            own.when if isinstance(own.when, str) else "all",
        )
        for own in found
        if own.effect != UNATTRIBUTED
    ]
    return OpenQuestions(path, file.study, file.cutoff_Hz, ties, tuple(named))
