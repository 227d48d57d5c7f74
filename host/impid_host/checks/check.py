"""What is said about a study's own input: one `Check` per finding, all of them together as `Checks`."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any, Literal

Verdict = Literal["impossible", "contradiction", "suspect"]
ORDER: tuple[Verdict, ...] = ("impossible", "contradiction", "suspect")


@dataclass(frozen=True, slots=True)
class Change:
    """One key of setup.toml and the value that mends the study; `check --fix` writes it.

    Attributes:
        table, key: of setup.toml, "encoder" and "zero_rad" say.
        value: the whole new value of the key.
    """

    table: str
    key: str
    value: Any


@dataclass(frozen=True, slots=True)
class Check:
    """One finding (docs/checks.md lists the names).

    Attributes:
        what: the name, "torque.sign" say.
        where: a joint, an axis, a trial, or a list of them joined by "+"; "" where it is the whole study.
        verdict: impossible, contradiction or suspect.
        words: one sentence for people.
        evidence: numbers behind it, before and after the change that would mend it.
        remedy: what to change, with the file and the key.
        changes: the remedy as keys of setup.toml, where it lies there.
    """

    what: str
    where: str
    verdict: Verdict
    words: str
    evidence: Mapping[str, Any] = field(default_factory=dict)
    remedy: str = ""
    changes: tuple[Change, ...] = ()

    @property
    def label(self) -> str:
        """`what@where`."""
        return f"{self.what}@{self.where}" if self.where else self.what

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "what": self.what,
            "where": self.where.split("+") if "+" in self.where else self.where,
            "verdict": self.verdict,
            "words": self.words,
            "evidence": {key: _plain(value) for key, value in self.evidence.items()},
            "remedy": self.remedy,
        }


@dataclass(frozen=True, slots=True)
class Checks:
    """All findings about one study or one result, the gravest first.

    >>> wrong = Check("torque.sign", "joint1", "impossible", "a torque has the wrong sign", {}, "turn it")
    >>> checks = Checks.of([Check("time.jump", "free_01", "suspect", "a row is missing"), wrong])
    >>> [check.label for check in checks]
    ['torque.sign@joint1', 'time.jump@free_01']
    >>> checks.impossible, checks.trusted, len(checks)
    (True, False, 2)
    >>> checks.with_more([]).to_dict()["checks"][0]["remedy"]
    'turn it'
    """

    entries: tuple[Check, ...] = ()

    @classmethod
    def of(cls, entries: Iterable[Check]) -> "Checks":
        """Sorted by gravity, one of each label (the gravest)."""
        by_label: dict[str, Check] = {}
        for entry in sorted(entries, key=lambda entry: ORDER.index(entry.verdict)):
            by_label.setdefault(entry.label, entry)
        return cls(tuple(by_label.values()))

    def with_more(self, more: "Checks | Iterable[Check]") -> "Checks":
        """These and others."""
        return Checks.of([*self.entries, *more])

    def __iter__(self) -> Iterator[Check]:
        return iter(self.entries)

    def __len__(self) -> int:
        return len(self.entries)

    @property
    def impossible(self) -> bool:
        """Something that no robot, arm or spring can have."""
        return any(entry.verdict == "impossible" for entry in self.entries)

    @property
    def trusted(self) -> bool:
        """Nothing impossible, and no two measurements of one thing that disagree."""
        return all(entry.verdict == "suspect" for entry in self.entries)

    def to_dict(self) -> dict[str, Any]:
        """The keys `checks` and `trusted` of every JSON."""
        return {"checks": [entry.to_dict() for entry in self.entries], "trusted": self.trusted}

    def _repr_html_(self) -> str:
        """For a notebook: a line for each finding, or that there is none."""
        if not self.entries:
            return "<p>Nothing contradicts itself or physics.</p>"
        lines = (
            f"<li><strong>{escape(entry.verdict)}</strong> {escape(entry.label)}: {escape(entry.words)}"
            f"{f'<br>Remedy: {escape(entry.remedy)}' if entry.remedy else ''}</li>"
            for entry in self.entries
        )
        return f"<ul>{''.join(lines)}</ul>"


def _plain(value: Any) -> Any:
    """A value JSON can hold: numpy scalars and arrays become Python's, what is no number null."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
