"""What a study is, before any work on it, and what is said of one that cannot be used."""

import hashlib
import json
import traceback
from dataclasses import replace
from pathlib import Path

from impid_host.batch.task import Answer, BatchOptions, Status
from impid_host.errors import ImpidError, InputError
from impid_host.study.hashes import file_hashes

_HERE = Path(__file__).parents[1]


def looked_at(address: str, folder: Path, options: BatchOptions) -> Answer:
    """What the study is, before any work: the hash of its data, and the key of a result of it."""
    try:
        digest = _hash(folder)
    except OSError as error:
        return broken(Answer(address, "unreadable"), error)
    return Answer(address, "fitted", options.key(digest), digest, study=folder.resolve().name)


def _hash(folder: Path) -> str:
    """One SHA-256 of a study's files, wherever the folder lies."""
    return hashlib.sha256(json.dumps(file_hashes(folder), sort_keys=True).encode()).hexdigest()


def broken(first: Answer, error: Exception) -> Answer:
    """The answer where a study cannot be read, or the work ends in an error."""
    if isinstance(error, InputError):
        status: Status = "unreadable" if first.key == "" else "bad data"
        return replace(first, status=status, why=f"{error.where}: {error.what}", remedy=error.remedy)
    if isinstance(error, ImpidError):
        return replace(first, status="undetermined", why=str(error))
    if isinstance(error, OSError):
        why = f"{error.filename or first.place}: {error.strerror or error}"
        return replace(first, status="unreadable", why=why, remedy="check path and permissions")
    frames = traceback.extract_tb(error.__traceback__)
    last = next((frame for frame in reversed(frames) if _HERE in Path(frame.filename).parents), frames[-1])
    why = f"{type(error).__name__}: {error} ({Path(last.filename).name}, line {last.lineno})"
    remedy = f"a defect of impid, please report it; `impid-host fit {first.place}` shows it whole"
    return replace(first, status="crashed", why=why, remedy=remedy)
