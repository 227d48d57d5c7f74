"""Finds and reads scenarios: those that ship with the package by name, a user's own by path."""

import tomllib
from pathlib import Path

from pydantic import ValidationError

from hil_sim.effects import catalogue
from hil_sim.errors import SimError
from hil_sim.scenarios.schema import Scenario, Trial

SHIPPED = Path(__file__).parent


def names() -> list[str]:
    """Names of the scenarios that ship with the package."""
    # Tables that several scenarios may draw on lie in the same folder; they carry no format of a scenario.
    return sorted(
        path.stem
        for path in SHIPPED.glob("*.toml")
        if "format" in tomllib.loads(path.read_text(encoding="utf-8"))
    )


def load(name_or_path: str) -> Scenario:
    """Reads a scenario.

    Args:
        name_or_path: a shipped scenario's name, or the path of a TOML file.

    Raises:
        SimError: there is none, or it says something that cannot be.
    """
    path = SHIPPED / f"{name_or_path}.toml" if name_or_path in names() else Path(name_or_path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        shipped = ", ".join(names())
        raise SimError(f"{name_or_path}: no such scenario; name a TOML file or one of {shipped}") from None
    try:
        content = tomllib.loads(text)
        for one in content.get("trials", []):
            if isinstance(one, dict) and "command_csv" in one:
                one["command_csv"] = str(path.parent / str(one["command_csv"]))
        scenario = Scenario.model_validate(content)
        for one in scenario.effects:
            catalogue.entry(
                one.effect, one.places, one.trials, one.values, when=one.when, per_trial=one.per_trial
            )
    except tomllib.TOMLDecodeError as error:
        raise SimError(f"{path}: not valid TOML, {error}; correct that line") from None
    except ValidationError as error:
        raise SimError(_one_line(path, error)) from None
    except SimError as error:
        raise SimError(f"{path}: {error}") from None
    return scenario


def trial(scenario: Scenario, name: str) -> Trial:
    """The trial of that name.

    Raises:
        SimError: there is none.
    """
    for candidate in scenario.trials:
        if candidate.name == name:
            return candidate
    there = ", ".join(candidate.name for candidate in scenario.trials)
    raise SimError(f"trial {name}: not in this scenario; use one of {there}")


def _one_line(path: Path, error: ValidationError) -> str:
    """The first complaint as one line: file, key, what is wrong, what to do."""
    first = error.errors(include_url=False, include_context=False)[0]
    key = ".".join(str(part + 1) if isinstance(part, int) else part for part in first["loc"]) or "the file"
    what = first["msg"].removeprefix("Value error, ")
    remedy = {
        "extra_forbidden": "remove the key or correct its spelling (docs/simulator.md lists all keys)",
        "missing": "add the key",
    }.get(first["type"], f"it says {str(first['input'])[:60]}")
    count = error.error_count()
    more = f" ({count - 1} more)" if count > 1 else ""
    return f"{path}: {key}: {what}; {remedy}{more}"
