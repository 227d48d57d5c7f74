"""`trial.toml`: what one trial is."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import tomli_w
from pydantic import Field, model_validator

from impid_host.study.model import Session, Trial, TrialKind
from impid_host.study.notices import notice
from impid_host.study.setup_file import SessionTable, said
from impid_host.study.toml_file import load_toml, validate


class _TrialFile(SessionTable):
    kind: TrialKind
    on: Literal["mass-spring", "arm"] | None = None
    load: Annotated[str, Field(min_length=1)] | None = None
    payload_kg: Annotated[float, Field(ge=0)] | None = None
    note: str = ""

    @model_validator(mode="after")
    def _says_what_is_shaken(self) -> Self:
        if self.kind == "stochastic" and self.on is None:
            raise ValueError('kind "stochastic" needs on = "mass-spring" or on = "arm"')
        return self


@dataclass(frozen=True, slots=True)
class TrialHead:
    """What `trial.toml` says; `payload_kg` is None when nothing was weighed."""

    kind: TrialKind
    load: str
    on: Literal["mass-spring", "arm"] | None
    payload_kg: float | None
    note: str
    session: Session


def default_load(trial_name: str) -> str:
    """The load's name where none is given: the folder's name up to the last `_NN`."""
    return re.sub(r"_[0-9]+$", "", trial_name) or trial_name


def read_trial_head(path: Path) -> TrialHead:
    """Read `trial.toml`.

    Raises:
        InputError: the file is missing or a key of it is missing or wrong; names the key.
    """
    return head_from_table(load_toml(path), path, path.parent.name)


def head_from_table(table: dict[str, Any], path: Path, trial_name: str, *, prefix: str = "") -> TrialHead:
    """The trial that one table of `path` describes.

    Raises:
        InputError: a key is missing or wrong.
    """
    checked = validate(_TrialFile, table, path, prefix=prefix)
    on = checked.on
    if on is not None and checked.kind != "stochastic":
        notice(f'{path}: key `on` has a meaning for kind "stochastic" only and is ignored')
        on = None
    return TrialHead(
        kind=checked.kind,
        load=checked.load or default_load(trial_name),
        on=on,
        payload_kg=checked.payload_kg,
        note=checked.note,
        session=checked.session(),
    )


def write_trial_head(trial: Trial, path: Path) -> None:
    """Write `trial.toml` at `path`."""
    table: dict[str, Any] = {"kind": trial.kind, "load": trial.load}
    if trial.on is not None:
        table["on"] = trial.on
    if trial.payload_kg is not None:
        table["payload_kg"] = trial.payload_kg
    if trial.note:
        table["note"] = trial.note
    table |= said(trial.session)
    path.write_bytes(tomli_w.dumps(table).encode())
