"""setup.toml and trial.toml: what the laboratory knows, and nothing else."""

from pathlib import Path
from typing import Any

import tomli_w

from hil_sim.scenarios.schema import Scenario, Trial


def write_setup(scenario: Scenario, path: Path) -> None:
    """Writes the scenario's [setup] as the setup.toml of a study."""
    known = scenario.setup.model_dump(exclude_none=True)
    if scenario.setup.robot.single:
        known = {"robot": {"model": scenario.setup.robot.model}}
    content: dict[str, Any] = {"format": "impid-study/1", **known}
    path.write_text(tomli_w.dumps(_lists(content)), encoding="utf-8")


def write_trial(trial: Trial, path: Path) -> None:
    """Writes the trial.toml of a study."""
    content: dict[str, Any] = {"kind": trial.kind}
    if trial.on is not None:
        content["on"] = trial.on
    if trial.payload_kg is not None:
        content["payload_kg"] = trial.payload_kg
    if trial.load is not None:
        content["load"] = trial.load
    if trial.note:
        content["note"] = trial.note
    path.write_text(tomli_w.dumps(content), encoding="utf-8")


def _lists(value: Any) -> Any:
    """Tuples as lists: TOML has only those."""
    if isinstance(value, dict):
        return {key: _lists(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return list(value)
    return value
