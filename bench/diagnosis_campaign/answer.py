"""What `impid-host diagnose STUDY --json FILE` says, read as anyone could read it: nothing of the host is imported."""

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Json = dict[str, Any]
Array = NDArray[np.float64]


class NoAnswerError(Exception):
    """The host ended without an answer."""


@dataclass(frozen=True)
class Number:
    """A value of any shape with its interval, shape (..., 2)."""

    value: Array
    ci95: Array

    @classmethod
    def of(cls, said: Json) -> "Number":
        """An interval that is not given is that of nothing known."""
        value = np.asarray(said["value"], dtype=np.float64)
        if said.get("ci95") is None:
            return cls(value, np.stack([value - np.inf, value + np.inf], axis=-1))
        return cls(value, np.asarray(said["ci95"], dtype=np.float64))


def ask(study: Path) -> Json:
    """The answer of the `impid-host` that belongs to this Python.

    Raises:
        NoAnswerError: there is none; says the last line that the host wrote.
    """
    file = study.with_suffix(".json")
    command = [str(Path(sys.executable).parent / "impid-host"), "diagnose", str(study), "--json", str(file)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    if not file.exists():
        raise NoAnswerError(ended.stderr.strip().rpartition("\n")[2] or f"exit code {ended.returncode}")
    answer: Json = json.loads(file.read_text(encoding="utf-8"))
    return answer


def findings(answer: Json) -> list[Json]:
    """The effects that were added, in order."""
    return [stage["added"] for stage in answer["stages"] if stage["added"] is not None]


def label(added: Json) -> str:
    """NAME@PLACE+PLACE."""
    return f"{added['effect']}@{'+'.join(places(added))}"


def places(added: Json) -> list[str]:
    """Where it is said to be."""
    return [added["where"]] if isinstance(added["where"], str) else list(added["where"])


def values(said: Mapping[str, Json]) -> Iterator[tuple[str, str | None, Number]]:
    """Each parameter's name, the trial that it belongs to (None: all), and the number."""
    for name, one in said.items():
        if isinstance(one.get("value"), dict):
            for trial, value in one["value"].items():
                ci95 = (one.get("ci95") or {}).get(trial)
                yield name, trial, Number.of({"value": value, "ci95": ci95})
        elif one.get("value") is not None:
            yield name, None, Number.of(one)


def acts_in(added: Json, trials: Mapping[str, str | None]) -> set[str]:
    """The trials in which it is said to act, of those given with the names of their loads."""
    when = added.get("when", "all")
    if when in ("all", "free", "load"):
        return {
            name for name, load in trials.items() if when == "all" or (when == "load") == (load is not None)
        }
    named: Sequence[str] = [when] if isinstance(when, str) else when
    return {name for name, load in trials.items() if name in named or load in named}
