"""The augmented model as a file: what was found, on which data, so that later fits can use it."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from impid_host import __version__
from impid_host.diagnosis.base import structure_named, textbook_structure
from impid_host.diagnosis.result import Diagnosis, Number
from impid_host.diagnosis.saved_parts import (
    EffectTable,
    NumberTable,
    RangesTable,
    SavedEffect,
    SavedStage,
    SavedStructure,
    StageTable,
    StructureTable,
    part_json,
    stage_json,
    structure_json,
    values_json,
)
from impid_host.effects.effect import UNATTRIBUTED, Ranges
from impid_host.errors import InputError, UndeterminedError
from impid_host.impedance.campaign import StudyFit
from impid_host.impedance.identify import LoadFit, RobotFit
from impid_host.robot.model import robot_model
from impid_host.robot.terms import RobotStructure
from impid_host.signals.arrays import Floats
from impid_host.signals.quantiles import NORMAL_975
from impid_host.study.hashes import file_hashes
from impid_host.study.model import Study
from impid_host.study.toml_file import Table, validate

Json = dict[str, Any]
FORMAT = "impid-model/1"


@dataclass(frozen=True, slots=True)
class SavedModel:
    """What `diagnose --save-model` or `fit --save-model` wrote.

    Attributes:
        study: on which it was found; data_sha256: hashes of that study's files, by path within it.
        robot: the model's name; link_lengths_m, gravity_m_s2: of setup.toml.
        alpha: (p,); covariance: (p, p).
        loads: M, B, K and x0 of each load, as far as its model has them.
        structure: what alpha is multiplied with.
        ranges: of the motion on which the effects were found; None where there are none.
        stages: the first model and one effect more at each; textbook: that model on the same data, or None.
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
    loads: Mapping[str, Mapping[str, Number]]
    effects: tuple[SavedEffect, ...]
    structure: SavedStructure
    stages: tuple[SavedStage, ...]
    textbook: SavedStage | None
    ranges: Ranges | None


def model_json(diagnosis: Diagnosis, study: Study) -> Json:
    """Robot, loads and effects of the last stage with names, and the hashes of the study's files."""
    named = [stage for stage in diagnosis.stages if stage.added is None or stage.added.effect != UNATTRIBUTED]
    last = named[-1]
    alpha = last.alpha
    effects = [
        {"effect": stage.added.effect, "parts": [part_json(part) for part in stage.added.parts]}
        for stage in named
        if stage.added is not None
    ]
    model = robot_model(study.setup.robot)
    structure, textbook = structure_named(diagnosis.baseline, model), diagnosis.textbook
    # Where the robot is given, the first model stands for the textbook's too.
    given = textbook is not None and len(textbook.alpha.value) == len(structure.parameter_names)
    plain = structure if given else textbook_structure(model)
    return {
        **_head(study, diagnosis.fit_trials),
        "robot": {
            **_robot(study, structure, last.alpha_names, alpha.value),
            "ci95": alpha.ci95.tolist(),
            "covariance": (np.zeros(0) if alpha.covariance is None else alpha.covariance).tolist(),
        },
        "loads": {name: {key: _number(n) for key, n in load.items()} for name, load in last.loads.items()},
        "effects": effects,
        "stages": [stage_json(stage, structure) for stage in named],
        "textbook": None if textbook is None else stage_json(textbook, plain),
        "ranges": None if diagnosis.ranges is None else asdict(diagnosis.ranges),
    }


def fit_json(fit: StudyFit, study: Study, textbook: StudyFit | None) -> Json:
    """A fit's model without effects, and the textbook's on the same data.

    Raises:
        UndeterminedError: the fit found no robot.
    """
    robot = fit.robot.parameters if isinstance(fit.robot, RobotFit) else fit.robot
    if robot.origin == "unknown":
        raise UndeterminedError(f"study {study.name}: its robot is unknown, so there is no model to save")
    structure = robot.structure
    sd = np.sqrt(np.maximum(np.diag(robot.covariance), 0.0))
    numbers = {load.load: _matrices(load) for load in fit.loads}
    plain = None if textbook is None else _values(textbook)
    return {
        **_head(study, [trial.name for trial in fit.trials]),
        "robot": {
            **_robot(study, structure, structure.parameter_names, robot.value),
            "ci95": np.stack([robot.value - NORMAL_975 * sd, robot.value + NORMAL_975 * sd], axis=1).tolist(),
            "covariance": robot.covariance.tolist(),
        },
        "loads": numbers,
        "effects": [],
        "stages": [_values(fit)],
        "textbook": plain,
        "ranges": None,
    }


def _values(fit: StudyFit) -> Json:
    """Robot and loads of a fit; of a load that both methods give, the virtual sensor's comes first."""
    robot = fit.robot.parameters if isinstance(fit.robot, RobotFit) else fit.robot
    loads: dict[str, Floats] = {}
    for load in fit.loads:
        loads.setdefault(load.load, load.estimate.value)
    return values_json(robot.structure, robot.value, loads)


def _matrices(load: LoadFit) -> Json:
    quantities = {"M": load.M, "B": load.B, "K": load.K, "x0": load.x0}
    return {
        name: {"value": q.value.tolist(), "ci95": q.ci95.tolist(), "unit": q.unit}
        for name, q in quantities.items()
        if q is not None
    }


def _head(study: Study, trials: Sequence[str]) -> Json:
    return {
        "format": FORMAT,
        "made_by": f"impid {__version__}",
        "study": study.name,
        "fitted_on": list(trials),
        "data_sha256": {} if study.source is None else file_hashes(study.source),
    }


def _robot(study: Study, structure: RobotStructure, names: Sequence[str], alpha: Floats) -> Json:
    return {
        "model": study.setup.robot.model,
        "link_lengths_m": list(study.setup.robot.link_lengths_m),
        "gravity_m_s2": list(study.setup.robot.gravity_m_s2),
        "names": list(names),
        "alpha": alpha.tolist(),
        "structure": structure_json(structure),
    }


def save_model(diagnosis: Diagnosis, study: Study, path: Path) -> None:
    """Write the augmented model, replacing an earlier one in one step.

    Raises:
        InputError: the file cannot be written.
    """
    write_model(model_json(diagnosis, study), path)


def write_model(document: Json, path: Path) -> None:
    """Write a model, replacing an earlier one in one step.

    Raises:
        InputError: the file cannot be written.
    """
    draft = path.with_name(path.name + ".part")
    try:
        draft.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
        draft.replace(path)
    except OSError as error:
        raise InputError(
            path, f"cannot be written ({error.strerror})", "check path and permissions"
        ) from None


class _Robot(Table):
    model: str
    link_lengths_m: list[float] = Field(default_factory=list)
    gravity_m_s2: list[float] = Field(default_factory=lambda: [0.0, 0.0])
    names: list[str]
    alpha: list[float]
    ci95: list[list[float]] = Field(default_factory=list)
    covariance: list[list[float]] = Field(default_factory=list)
    structure: StructureTable = Field(default_factory=StructureTable)


class _ModelFile(Table):
    format: str
    made_by: str = ""
    study: str = ""
    fitted_on: list[str] = Field(default_factory=list)
    data_sha256: dict[str, str] = Field(default_factory=dict)
    robot: _Robot
    loads: dict[str, dict[str, NumberTable]] = Field(default_factory=dict)
    effects: list[EffectTable]
    stages: list[StageTable] = Field(default_factory=list)
    textbook: StageTable | None = None
    ranges: RangesTable | None = None


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
    effects = tuple(part for row in file.effects for part in row.read(path))
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
        {name: {key: n.read() for key, n in load.items()} for name, load in file.loads.items()},
        effects,
        robot.structure.read(path),
        tuple(stage.read(path) for stage in file.stages),
        None if file.textbook is None else file.textbook.read(path),
        None if file.ranges is None else file.ranges.read(),
    )


def same_files(saved: SavedModel, study: Study) -> tuple[str, ...]:
    """Logs of the study on which the model was found, by path within the study."""
    files = {} if study.source is None else file_hashes(study.source)
    known = set(saved.data_sha256.values())
    return tuple(name for name, digest in files.items() if name.endswith(".csv") and digest in known)


def _number(number: Number) -> Json:
    return {"value": number.value.tolist(), "ci95": number.ci95.tolist(), "unit": number.unit}
