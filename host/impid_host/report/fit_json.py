"""What `impid-host fit --json` and `impid-host sync --json` write; keys once used keep their meaning."""

from collections.abc import Sequence
from typing import Any

from impid_host.clock.robot import RobotClockFit
from impid_host.impedance.identify import LoadFit, Quantity, RobotFit, RobotParameters
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats

Json = dict[str, Any]
_METHODS = {"virtual sensor": "method1", "physical sensor": "method2"}


def fit_json(
    study: str,
    chain: str,
    trials: Sequence[AlignedTrial],
    robot: RobotFit | RobotParameters,
    loads: Sequence[LoadFit],
) -> Json:
    """The result of `fit`, format impid-fit/1. SI units; vectors [x, y], matrices [[xx, xy], [yx, yy]]."""
    by_load: dict[str, Json] = {}
    for fit in loads:
        by_load.setdefault(fit.load, {"model": fit.model.name})[_METHODS[fit.method]] = _load(fit)
    return {
        "format": "impid-fit/1",
        "study": study,
        "chain": chain,
        "trials": [
            {
                "name": trial.name,
                "kind": trial.kind,
                "load": trial.load,
                "acceleration": trial.source,
                "usable_share": float(trial.valid.mean()),
                "clock": None if trial.clock is None else clock_json(trial.clock),
            }
            for trial in trials
        ],
        "robot": _robot(robot),
        "loads": by_load,
    }


def clock_json(fit: RobotClockFit) -> Json:
    """One trial's clock match."""
    return {
        "offset_s": fit.offset_s,
        "offset_ci95_s": list(fit.offset_ci95_s),
        "drift_ppm": fit.drift_ppm,
        "drift_ci95_ppm": list(fit.drift_ci95_ppm),
        "robot_ref_s": fit.robot_ref_s,
        "device_ref_s": fit.device_ref_s,
        "overlap_s": fit.overlap_s,
        "rows_used": fit.rows_used,
        "rows_rejected": fit.rows_rejected,
        "residual_rms": fit.residual_rms.tolist(),
        "angle_offset": fit.angle_offset.tolist(),
    }


def _robot(robot: RobotFit | RobotParameters) -> Json:
    parameters = robot.parameters if isinstance(robot, RobotFit) else robot
    structure = parameters.structure
    result: Json = {
        "model": structure.model.name,
        "terms": [term.name for term in structure.terms],
        "origin": parameters.origin,
        "parameters": {
            name: {"value": float(value), "unit": unit}
            for name, value, unit in zip(
                structure.parameter_names, parameters.value, structure.parameter_units, strict=True
            )
        },
    }
    if isinstance(robot, RobotFit):
        for name, ci, sd in zip(robot.estimate.names, robot.estimate.ci95, robot.estimate.sd, strict=True):
            result["parameters"][name] |= {"ci95": ci.tolist(), "sd": float(sd)}
        keys = [f"tau{joint + 1}" for joint in range(len(robot.vaf))]
        result |= {
            "acceleration": sorted(set(robot.sources)),
            "held_out": robot.held_out,
            "vaf": _keyed(keys, robot.vaf),
            "validation_rms": _keyed(keys, robot.rms),
            "relative_error_percent": robot.estimate.relative_error_percent,
            "residual_rms": _keyed(keys, robot.estimate.residual_rms),
        }
    return result


def _load(fit: LoadFit) -> Json:
    keys = ["fx", "fy"]
    quantities = {"M": fit.M, "B": fit.B, "K": fit.K, "x0": fit.x0}
    return {name: _quantity(q) for name, q in quantities.items() if q is not None} | {
        "acceleration": sorted(set(fit.sources)),
        "held_out": fit.held_out,
        "vaf": _keyed(keys, fit.vaf),
        "validation_rms": _keyed(keys, fit.rms),
        "relative_error_percent": fit.estimate.relative_error_percent,
        "trials": [part.trial for part in fit.series],
    }


def _quantity(quantity: Quantity) -> Json:
    return {"value": quantity.value.tolist(), "ci95": quantity.ci95.tolist(), "unit": quantity.unit}


def _keyed(keys: Sequence[str], values: Floats) -> dict[str, float]:
    return {key: float(value) for key, value in zip(keys, values, strict=True)}
