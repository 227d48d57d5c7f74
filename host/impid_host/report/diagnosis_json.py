"""What `impid-host diagnose --json` writes, format impid-diagnosis/1; keys once used keep their meaning."""

from collections.abc import Mapping
from typing import Any

from impid_host.checks import Checks
from impid_host.diagnosis.result import Diagnosis, Finding, Floor, Number, Reported, Stage, Tie
from impid_host.report.diagnosis_units import structure_words

Json = dict[str, Any]


def diagnosis_json(diagnosis: Diagnosis, checks: Checks | None = None) -> Json:
    """The whole answer. SI units; vectors [x, y], matrices [[xx, xy], [yx, yy]]."""
    return {
        "format": "impid-diagnosis/1",
        "study": diagnosis.study,
        "baseline": diagnosis.baseline,
        "cutoff_Hz": diagnosis.cutoff_hz,
        "verdict": diagnosis.verdict,
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
        "ambiguous": [_tie(tie) for tie in diagnosis.ambiguous],
        "notes": list(diagnosis.notes),
    }


def _tie(tie: Tie) -> Json:
    """Candidates, the trial that tells them apart, and what would be reported under each."""
    under = {
        label: {"alpha": _number(alpha), "loads": {name: _numbers(load) for name, load in loads.items()}}
        for label, (alpha, loads) in tie.under.items()
    }
    return {"candidates": list(tie.candidates), "tell_apart_by": tie.tell_apart_by, "parameters": under}


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
    evidence = finding.evidence
    rival = evidence.runner_up
    return {
        "effect": finding.effect,
        "where": place_of(finding.where),
        "when": finding.when,
        "carries": finding.carries,
        "parameters": _numbers(finding.parameters),
        "evidence": {
            "share_of_residual": evidence.share_of_residual,
            "gain": evidence.gain,
            "gain_se": evidence.gain_se,
            "confidence": evidence.confidence,
            "runner_up": None
            if rival is None
            else {"effect": rival.effect, "where": place_of(rival.where), "margin": rival.margin},
        },
    }


def _numbers(numbers: Mapping[str, Reported]) -> Json:
    return {name: _number(own) if isinstance(own, Number) else _by_name(own) for name, own in numbers.items()}


def _by_name(numbers: Mapping[str, Number]) -> Json:
    """A parameter that each trial or load has for itself: value and interval by its name."""
    unit = next(iter(numbers.values())).unit
    return {
        "value": {name: own.value.tolist() for name, own in numbers.items()},
        "ci95": {name: own.ci95.tolist() for name, own in numbers.items()},
        "unit": unit,
    }


def _number(number: Number) -> Json:
    return {"value": number.value.tolist(), "ci95": number.ci95.tolist(), "unit": number.unit}
