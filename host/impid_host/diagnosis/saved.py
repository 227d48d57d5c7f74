"""The augmented model as a file: what was found, on which data, so that later fits can use it."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from impid_host import __version__
from impid_host.diagnosis.result import Chosen, Diagnosis, Number
from impid_host.effects.effect import UNATTRIBUTED
from impid_host.errors import InputError
from impid_host.signals.arrays import Floats
from impid_host.study.model import Study
from impid_host.study.toml_file import Table, validate

Json = dict[str, Any]
FORMAT = "impid-model/1"


@dataclass(frozen=True, slots=True)
class SavedEffect:
    """One part of an effect in the model: a candidate of the catalogue and its parameters.

    Attributes:
        when: in which trials it acts; own: trials or loads that have a value each.
        beta: (q,); shape: the non-linear parameter.
        covariance: of beta, and the shape where that was fitted, (k, k).
    """

    effect: str
    where: tuple[str, ...]
    variant: str
    when: str
    own: tuple[str, ...]
    shape: float
    beta: Floats
    covariance: Floats

    @property
    def label(self) -> str:
        """`name@place`."""
        return f"{self.effect}@{'+'.join(self.where)}"


@dataclass(frozen=True, slots=True)
class SavedModel:
    """What `diagnose --save-model` wrote.

    Attributes:
        study: on which it was found; data_sha256: hashes of that study's files, by path within it.
        robot: the model's name; link_lengths_m, gravity_m_s2: of setup.toml.
        alpha: (p,); covariance: (p, p).
        loads: names of the loads.
    """

    path: Path
    study: str
    made_by: str
    data_sha256: dict[str, str]
    robot: str
    link_lengths_m: tuple[float, ...]
    gravity_m_s2: tuple[float, ...]
    names: tuple[str, ...]
    alpha: Floats
    covariance: Floats
    loads: tuple[str, ...]
    effects: tuple[SavedEffect, ...]


def model_json(diagnosis: Diagnosis, study: Study) -> Json:
    """Robot, loads and effects of the last stage with names, and the hashes of the study's files."""
    named = [stage for stage in diagnosis.stages if stage.added is None or stage.added.effect != UNATTRIBUTED]
    last = named[-1]
    alpha = last.alpha
    effects = [
        {"effect": stage.added.effect, "parts": [_part(part) for part in stage.added.parts]}
        for stage in named
        if stage.added is not None
    ]
    return {
        "format": FORMAT,
        "made_by": f"impid {__version__}",
        "study": diagnosis.study,
        "fitted_on": list(diagnosis.fit_trials),
        "data_sha256": {} if study.source is None else file_hashes(study.source),
        "robot": {
            "model": study.setup.robot.model,
            "link_lengths_m": list(study.setup.robot.link_lengths_m),
            "gravity_m_s2": list(study.setup.robot.gravity_m_s2),
            "names": list(last.alpha_names),
            "alpha": alpha.value.tolist(),
            "ci95": alpha.ci95.tolist(),
            "covariance": (np.zeros(0) if alpha.covariance is None else alpha.covariance).tolist(),
        },
        "loads": {name: {key: _number(n) for key, n in load.items()} for name, load in last.loads.items()},
        "effects": effects,
    }


def save_model(diagnosis: Diagnosis, study: Study, path: Path) -> None:
    """Write the augmented model, replacing an earlier one in one step.

    Raises:
        InputError: the file cannot be written.
    """
    draft = path.with_name(path.name + ".part")
    try:
        draft.write_text(json.dumps(model_json(diagnosis, study), indent=2) + "\n", encoding="utf-8")
        draft.replace(path)
    except OSError as error:
        raise InputError(
            path, f"cannot be written ({error.strerror})", "check path and permissions"
        ) from None


class _Part(Table):
    where: list[str]
    variant: str = ""
    when: str = "all"
    own: list[str] = Field(default_factory=list)
    shape: float
    beta: list[float] = Field(min_length=1)
    covariance: list[list[float]]


class _Effect(Table):
    effect: str
    parts: list[_Part]


class _Robot(Table):
    model: str
    link_lengths_m: list[float] = Field(default_factory=list)
    gravity_m_s2: list[float] = Field(default_factory=lambda: [0.0, 0.0])
    names: list[str]
    alpha: list[float]
    ci95: list[list[float]] = Field(default_factory=list)
    covariance: list[list[float]] = Field(default_factory=list)


class _ModelFile(Table):
    format: str
    made_by: str = ""
    study: str = ""
    fitted_on: list[str] = Field(default_factory=list)
    data_sha256: dict[str, str] = Field(default_factory=dict)
    robot: _Robot
    loads: dict[str, Any] = Field(default_factory=dict)
    effects: list[_Effect]


def read_model(path: Path) -> SavedModel:
    """Read what `diagnose --save-model` wrote.

    Raises:
        InputError: the file is missing, no JSON, of another format, or a key of it does not fit.
    """
    remedy = "make it with `impid-host diagnose STUDY --save-model model.json`"
    try:
        data = json.loads(path.read_bytes())
    except FileNotFoundError:
        raise InputError(path, "does not exist", remedy) from None
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from None
    except (ValueError, RecursionError) as error:
        raise InputError(path, f"is no model file ({str(error)[:80]})", remedy) from None
    written = data.get("format") if isinstance(data, dict) else None
    if written != FORMAT:
        raise InputError(path, f"has format {written!r}, not {FORMAT!r}", remedy)
    file = validate(_ModelFile, data, path)
    robot = file.robot
    size = len(robot.alpha)
    covariance = np.array(robot.covariance) if robot.covariance else np.zeros((size, size))
    effects = tuple(
        SavedEffect(
            row.effect,
            tuple(part.where),
            part.variant,
            part.when,
            tuple(part.own),
            part.shape,
            np.array(part.beta),
            _square(path, row.effect, part),
        )
        for row in file.effects
        for part in row.parts
    )
    if covariance.shape != (size, size) or len(robot.names) != size:
        raise InputError(path, "robot: names, alpha and covariance differ in size", remedy)
    return SavedModel(
        path,
        file.study,
        file.made_by,
        file.data_sha256,
        robot.model,
        tuple(robot.link_lengths_m),
        tuple(robot.gravity_m_s2),
        tuple(robot.names),
        np.array(robot.alpha),
        covariance,
        tuple(file.loads),
        effects,
    )


def _square(path: Path, effect: str, part: _Part) -> Floats:
    covariance = np.array(part.covariance)
    if covariance.ndim != 2 or covariance.shape[0] != covariance.shape[1]:
        raise InputError(path, f"{effect}: its covariance is no square matrix", "write the model again")
    return covariance


def file_hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of setup.toml and of every trial's files, by path within the study."""
    places = [folder / "setup.toml", *sorted(folder.glob("*/trial.toml")), *sorted(folder.glob("*/*.csv"))]
    return {
        place.relative_to(folder).as_posix(): hashlib.sha256(place.read_bytes()).hexdigest()
        for place in places
        if place.is_file()
    }


def _part(part: Chosen) -> Json:
    return {
        "where": list(part.term.where),
        "variant": part.term.variant,
        "when": part.term.when,
        "own": list(part.term.own),
        "shape": part.shape,
        "beta": part.beta.tolist(),
        "covariance": part.covariance.tolist(),
    }


def _number(number: Number) -> Json:
    return {"value": number.value.tolist(), "ci95": number.ci95.tolist(), "unit": number.unit}
