"""What `impid-host diagnose --json` writes, format impid-diagnosis/1; keys once used keep their meaning."""

from collections.abc import Mapping
from typing import Any

from impid_host.checks import Checks
from impid_host.diagnosis.result import Diagnosis, Finding, Floor, Number, Stage
from impid_host.report.diagnosis_units import structure_words

Json = dict[str, Any]
LEAST_P = 1e-300  # below it a test underflows to zero, which no p-value is


def diagnosis_json(diagnosis: Diagnosis, checks: Checks | None = None) -> Json:
    """The whole answer. SI units; vectors [x, y], matrices [[xx, xy], [yx, yy]]."""
    return {
        "format": "impid-diagnosis/1",
        "study": diagnosis.study,
        **({} if checks is None else checks.to_dict()),
        "trials": {
            "fit": list(diagnosis.fit_trials),
            "validation": list(diagnosis.validation_trials),
        },
        "stages": [_stage(stage) for stage in diagnosis.stages],
        "noise_floor": dict(diagnosis.floor),
        "noise_floor_origin": {key: _origin(diagnosis.told, key) for key in diagnosis.floor},
        "unexplained": {
            "share_of_residual": diagnosis.share_unexplained,
            "above_noise_floor": diagnosis.above_noise_floor,
            "structure": [
                {
                    "variable": row.variable,
                    "on": row.on,
                    "share": row.share,
                    "curve": row.curve.tolist(),
                    "band": row.band.tolist(),
                    "words": structure_words(row, diagnosis),
                }
                for row in diagnosis.structure
            ],
        },
        "ambiguous": [
            {"candidates": list(tie.candidates), "tell_apart_by": tie.tell_apart_by}
            for tie in diagnosis.ambiguous
        ],
        "notes": list(diagnosis.notes),
    }


def _origin(told: Floor, key: str) -> Json:
    return {
        "used": told.origin(key),
        "saturated_model": told.saturated.get(key),
        "repeated_motion": told.repeated.get(key),
        "specification": told.specified.get(key),
    }


def place_of(where: tuple[str, ...]) -> str | list[str]:
    """A single place as a word, several as a list."""
    return where[0] if len(where) == 1 else list(where)


def _stage(stage: Stage) -> Json:
    parameters: Json = {"alpha": _number(stage.alpha) | {"names": list(stage.alpha_names)}}
    if stage.loads:
        parameters["loads"] = {name: _numbers(load) for name, load in stage.loads.items()}
    if len(stage.loads) == 1:
        parameters |= _numbers(next(iter(stage.loads.values())))
    return {
        "added": None if stage.added is None else _added(stage.added),
        "validation_rms": dict(stage.rms),
        "vaf": dict(stage.vaf),
        "parameters": parameters,
    }


def _added(finding: Finding) -> Json:
    rival = finding.runner_up
    return {
        "effect": finding.effect,
        "where": place_of(finding.where),
        "parameters": _numbers(finding.parameters),
        "evidence": {
            "share_of_residual": finding.share_of_residual,
            "p_value": max(finding.p_value, LEAST_P),
            "runner_up": None
            if rival is None
            else {"effect": rival.effect, "where": place_of(rival.where), "margin": rival.margin},
        },
    }


def _numbers(numbers: Mapping[str, Number]) -> Json:
    return {name: _number(number) for name, number in numbers.items()}


def _number(number: Number) -> Json:
    return {"value": number.value.tolist(), "ci95": number.ci95.tolist(), "unit": number.unit}
