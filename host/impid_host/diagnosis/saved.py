"""The augmented model as a file: what was found, on which data, so that later fits can use it."""

import hashlib
import json
from pathlib import Path
from typing import Any

from impid_host import __version__
from impid_host.diagnosis.result import Diagnosis, Number
from impid_host.study.model import Study

Json = dict[str, Any]
FORMAT = "impid-model/1"


def model_json(diagnosis: Diagnosis, study: Study) -> Json:
    """Robot, loads and effects of the last stage, with the hashes of the study's files."""
    last = diagnosis.stages[-1]
    effects = [
        {
            "effect": stage.added.effect,
            "parts": [
                {
                    "where": list(part.candidate.where),
                    "variant": part.candidate.variant,
                    "shape": part.shape,
                    "beta": part.beta.tolist(),
                    "covariance": part.covariance.tolist(),
                }
                for part in stage.added.parts
            ],
        }
        for stage in diagnosis.stages
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
            "names": list(last.alpha_names),
            "alpha": last.alpha.value.tolist(),
            "ci95": last.alpha.ci95.tolist(),
        },
        "loads": {name: {key: _number(n) for key, n in load.items()} for name, load in last.loads.items()},
        "effects": effects,
    }


def save_model(diagnosis: Diagnosis, study: Study, path: Path) -> None:
    """Write the augmented model, replacing an earlier one in one step."""
    draft = path.with_name(path.name + ".part")
    draft.write_text(json.dumps(model_json(diagnosis, study), indent=2) + "\n", encoding="utf-8")
    draft.replace(path)


def file_hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of setup.toml and of every trial's files, by path within the study."""
    places = [folder / "setup.toml", *sorted(folder.glob("*/trial.toml")), *sorted(folder.glob("*/*.csv"))]
    return {
        place.relative_to(folder).as_posix(): hashlib.sha256(place.read_bytes()).hexdigest()
        for place in places
        if place.is_file()
    }


def _number(number: Number) -> Json:
    return {"value": number.value.tolist(), "ci95": number.ci95.tolist(), "unit": number.unit}
