"""What is asked of a worker about one study, and what it answers; both go through JSON."""

import hashlib
import json
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from impid_host import __version__

Status = Literal["fitted", "undetermined", "bad data", "unreadable", "crashed", "timed out", "done before"]
# No result: reported, and tried again the next time.
BROKEN: tuple[Status, ...] = ("bad data", "unreadable", "crashed", "timed out")
_DIGITS = 20


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """What is to be found out about each study.

    Attributes:
        diagnose: look for what the first model lacks.
        terms: optional terms of the robot model, as `fit --with`.
    """

    diagnose: bool = False
    terms: tuple[str, ...] = ()

    def key(self, data_sha256: str) -> str:
        """Names a result: the same data, options and version have the same one."""
        return _digest({"data": data_sha256, "impid": __version__, **asdict(self)})

    def to_json(self) -> str:
        """As the data set has them."""
        return json.dumps(asdict(self))


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of one study.

    Attributes:
        place: its address; data_sha256: of all its files together, "" where they could not be read.
        key: `BatchOptions.key`.
        rows: one for each number, the fields of `sessions.long_table.Row` in their order.
        verdict, checks: as `diagnose` and `check` have them; effects: what was added to the first model.
        why, remedy: of what is missing.
        notices: oddities of the files that were coped with.
        versions: of Python and the packages that made the numbers.
        worker: where it ran.
    """

    place: str
    status: Status
    key: str = ""
    data_sha256: str = ""
    rows: tuple[tuple[Any, ...], ...] = ()
    study: str = ""
    session: tuple[str, str, str, str] = ("", "", "", "")
    trusted: bool = False
    verdict: str = ""
    checks: tuple[dict[str, str], ...] = ()
    effects: tuple[str, ...] = ()
    why: str = ""
    remedy: str = ""
    notices: tuple[str, ...] = ()
    versions: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    worker: str = ""

    @property
    def impossible(self) -> bool:
        """Something that no robot, arm or spring can have."""
        return any(check["verdict"] == "impossible" for check in self.checks)

    def to_json(self) -> str:
        """In one line."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str | bytes) -> "Answer":
        """As it was."""
        document = json.loads(text)
        for name in ("rows", "session", "checks", "effects", "notices"):
            document[name] = tuple(document[name])
        document["rows"] = tuple(tuple(row) for row in document["rows"])
        return cls(**document)


def place_key(address: str) -> str:
    """Short name of a study's place, by which an older result of the same place is found."""
    return _digest(address)


def _digest(thing: Any) -> str:
    return hashlib.sha256(json.dumps(thing, sort_keys=True).encode()).hexdigest()[:_DIGITS]
