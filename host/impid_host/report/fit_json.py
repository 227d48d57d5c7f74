"""What `impid-host fit --json` and `impid-host sync --json` write; keys once used keep their meaning."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from impid_host.checks import Checks
from impid_host.checks.pushes import Pushes
from impid_host.clock.robot import RobotClockFit
from impid_host.impedance.campaign import StudyFit
from impid_host.impedance.constrained import Constrained
from impid_host.impedance.estimators.estimated import Estimated
from impid_host.impedance.force import ForceComparison
from impid_host.impedance.identify import LoadFit, RobotFit, RobotParameters
from impid_host.impedance.joint_space import JointImpedance
from impid_host.impedance.matrices import Quantity
from impid_host.impedance.partial import PartialLoadFit
from impid_host.impedance.periodic import Periodic
from impid_host.impedance.physical import PhysicalRobot
from impid_host.report.fit_parts import Besides
from impid_host.report.reflex_report import reflex_json
from impid_host.report.varying_report import varying_json
from impid_host.robot.model import LINK
from impid_host.signals.arrays import Floats

if TYPE_CHECKING:
    from impid_host.impedance.stochastic import SpectralFit

Json = dict[str, Any]
_METHODS = {"virtual sensor": "method1", "physical sensor": "method2"}


def fit_json(
    fit: StudyFit,
    besides: Besides,
    *,
    checks: Checks | None = None,
) -> Json:
    """The result of `fit`, format impid-fit/1. SI units; vectors [x, y], matrices [[xx, xy], [yx, yy]]."""
    by_load: dict[str, Json] = {}
    pushes = besides.pushes
    for load in fit.loads:
        by_load.setdefault(load.load, {"model": load.model.name})[_METHODS[load.method]] = _load(
            load
        ) | _without(load, pushes)
    for some in fit.partial:
        by_load.setdefault(some.load, {"model": some.model.name})[_METHODS[some.method]] = _partial(some)
    for shaken in fit.spectral:
        by_load[shaken.load].setdefault("spectral", {})[_METHODS[shaken.method]] = _spectral(shaken)
    for tight in besides.constrained:
        by_load[tight.load].setdefault("constrained", {})[_METHODS[tight.method]] = _constrained(tight)
    for joint in besides.joints:
        by_load[joint.load].setdefault("joint_space", {})[_METHODS[joint.method]] = _joint(joint)
    for compared in fit.forces:
        by_load.setdefault(compared.load, {})["virtual_against_physical_force"] = _force(compared)
    return {
        "format": "impid-fit/1",
        "study": fit.study,
        **({} if checks is None else checks.to_dict()),
        **(
            {}
            if besides.agreement is None
            else {"agreement": [pair.to_dict() for pair in besides.agreement.pairs]}
        ),
        "chain": fit.chain,
        "cutoff_Hz": fit.cutoff_hz,
        "trials": [
            {
                "name": trial.name,
                "kind": trial.kind,
                "load": trial.load,
                "acceleration": trial.source,
                "usable_share": float(trial.valid.mean()),
                "clock": None if trial.clock is None else clock_json(trial.clock),
            }
            for trial in fit.trials
        ],
        "events": [
            {
                "trial": push.trial,
                "begin_s": push.begin_s,
                "end_s": push.end_s,
                "power_ratio": push.ratio,
                "in_fit": push.fitted,
            }
            for push in pushes.found
        ],
        "robot": _robot(fit.robot, fit.physical)
        | ({} if pushes.robot is None else {"without_events": _robot(pushes.robot, None)["parameters"]}),
        "loads": by_load,
        **({} if not besides.reflexes else {"reflex": reflex_json(besides.reflexes)}),
        **({} if not besides.curves else {"varying": varying_json(besides.curves)}),
    }


def _without(fit: LoadFit, pushes: Pushes) -> Json:
    """The same load fitted without events, where some took part in the fit."""
    rest = pushes.without(fit)
    if rest is None:
        return {}
    quantities = {"M": rest.M, "B": rest.B, "K": rest.K, "x0": rest.x0}
    return {"without_events": {name: _quantity(q) for name, q in quantities.items() if q is not None}}


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


def _robot(robot: RobotFit | RobotParameters, physical: PhysicalRobot | None) -> Json:
    parameters = robot.parameters if isinstance(robot, RobotFit) else robot
    structure = parameters.structure
    # What the trials leave open stands there as the combinations that they determine.
    names, units = structure.parameter_names, structure.parameter_units
    values = parameters.value
    if isinstance(robot, RobotFit):
        names, units, values = robot.estimate.names, robot.estimate.units, robot.estimate.value
    result: Json = {
        "model": structure.model.name,
        "terms": [term.name for term in structure.terms],
        "origin": parameters.origin,
        "parameters": {
            name: {"value": float(value), "unit": unit}
            for name, value, unit in zip(names, values, units, strict=True)
            if np.isfinite(value)
        },
    }
    if isinstance(robot, RobotFit):
        for name, ci, sd in zip(robot.estimate.names, robot.estimate.ci95, robot.estimate.sd, strict=True):
            result["parameters"][name] |= {"ci95": ci.tolist(), "sd": float(sd)}
        keys = [f"tau{joint + 1}" for joint in robot.joints]
        result |= {
            "acceleration": sorted(set(robot.sources)),
            "held_out": robot.held_out,
            "vaf": _keyed(keys, robot.vaf),
            "validation_rms": _keyed(keys, robot.rms),
            "relative_error_percent": robot.estimate.relative_error_percent,
            "residual_rms": _keyed(keys, robot.estimate.residual_rms),
            **_estimated(robot.estimated),
        }
        if physical is not None:
            result["physical"] = _physical(physical, structure.parameter_names, keys)
        for name, meaning in structure.model.parameter_meanings.items():
            if name in result["parameters"]:
                result["parameters"][name]["meaning"] = meaning
        if robot.resting:
            result["resting"] = [f"joint{joint + 1}" for joint in robot.resting]
    return result


def _physical(robot: PhysicalRobot, names: Sequence[str], keys: Sequence[str]) -> Json:
    return {
        "parameters": _keyed(names, robot.value),
        "links": [_keyed(LINK, link) for link in robot.links],
        "worse_percent": robot.worse_percent,
        "vaf": _keyed(keys, robot.vaf),
        "validation_rms": _keyed(keys, robot.rms),
    }


def _load(fit: LoadFit) -> Json:
    keys = ["torque"] if fit.model.rotary else [f"f{axis}" for axis in fit.model.axes]
    quantities = {"M": fit.M, "B": fit.B, "K": fit.K, "x0": fit.x0}
    return {name: _quantity(q) for name, q in quantities.items() if q is not None} | {
        "acceleration": sorted(set(fit.sources)),
        "held_out": fit.held_out,
        "vaf": _keyed(keys, fit.vaf),
        "validation_rms": _keyed(keys, fit.rms),
        "relative_error_percent": fit.estimate.relative_error_percent,
        "trials": [part.trial for part in fit.series],
        **_estimated(fit.estimated),
        **(
            {}
            if fit.beyond_force_percent is None
            else {"torque_beyond_force_percent": fit.beyond_force_percent}
        ),
    }


def _estimated(own: Estimated | None) -> Json:
    """By which estimator, where one was asked for."""
    if own is None:
        return {}
    bias = None if own.bias_sd is None else dict(zip(("found", "at_most"), own.bias_sd, strict=True))
    return {
        "estimator": {
            "by": own.by,
            "reason": own.reason,
            "instruments": own.instruments,
            "least_squares_bias_sd": bias,
        }
    }


def _force(compared: ForceComparison) -> Json:
    keys = [f"f{axis}" for axis in compared.axes]
    return {
        "trials": list(compared.trials),
        "held_out": compared.held_out,
        "signal_rms_N": _keyed(keys, compared.signal_rms),
        "errors": [
            {
                "by": error.by,
                "rms_N": _keyed(keys, error.rms),
                "relative_percent": _keyed(keys, error.relative_percent),
                "bias_N": _keyed(keys, error.bias),
            }
            for error in compared.errors
        ],
    }


def _partial(fit: PartialLoadFit) -> Json:
    own = fit.estimate
    return {
        "combinations": {
            name: {"value": float(value), "unit": unit, "ci95": ci.tolist(), "sd": float(sd)}
            for name, value, unit, ci, sd in zip(
                own.names, own.value, own.units, own.ci95, own.sd, strict=True
            )
        },
        "reason": fit.reason,
        "trials": list(fit.trials),
    }


def _spectral(fit: "SpectralFit") -> Json:
    from impid_host.impedance.stochastic import quantities_of  # noqa: PLC0415  (slow to import)

    both = fit.against
    return {name: _quantity(getattr(fit, name)) for name in "MBK"} | {
        "estimate": "derived" if fit.estimate.derived is not None else "direct",
        "window": fit.setting,
        "segments": fit.estimate.segments,
        "as_published": {
            name: _quantity(quantity)
            for name, quantity in zip("MBK", quantities_of(fit.estimate.best.fit), strict=True)
        },
        "agreement": [
            {
                "upper_Hz": part.upper_Hz,
                "vaf": [[float(v) if np.isfinite(v) else None for v in row] for row in part.vaf_percent],
                "r_squared": part.r_squared,
            }
            for part in fit.estimate.best.agreement
        ],
        "checks": [str(check) for check in fit.estimate.checks],
        "against_time_domain": {
            "verdict": both.verdict,
            "quantities": {
                name: {
                    "time_domain": float(both.first[k]),
                    "time_domain_sd": float(both.first_sd[k]),
                    "spectral": float(both.second[k]),
                    "spectral_sd": float(both.second_sd[k]),
                    "standard_errors_apart": float(both.z[k]),
                }
                for k, name in enumerate(both.names)
            },
        },
        "periodic": None if fit.periodic is None else _periodic(fit.periodic),
        "trials": list(fit.trials),
    }


def _periodic(found: Periodic) -> Json:
    part = found.compliance
    return {
        "verdict": part.verdict,
        "period_s": found.period_s,
        "realisations": part.realisations,
        "periods": part.periods,
        "frequency_Hz": part.frequency_Hz.tolist(),
        "compliance_m_per_N": {"real": part.G.real.tolist(), "imag": part.G.imag.tolist()},
        "noise_sd": part.noise_sd.tolist(),
        "total_sd": part.total_sd.tolist(),
        "distortion_sd": part.distortion_sd.tolist(),
        "p_value": part.p_value,
        "distortion": [
            {
                "verdict": level.verdict,
                "excited_m": level.excited,
                "odd_m": level.odd,
                "even_m": level.even,
                "noise_m": level.noise,
                "p_odd": level.p_odd,
                "p_even": level.p_even,
            }
            for level in found.distortion
        ],
    }


def _constrained(fit: Constrained) -> Json:
    quantities = {name: getattr(fit.matrices, name) for name in ("M", "B", "K", "x0")}
    return {name: _quantity(q) for name, q in quantities.items() if q is not None} | {
        "chi2": fit.chi2,
        "p_value": fit.p_value,
        "on_boundary": list(fit.on_boundary),
        "verdict": fit.verdict,
    }


def _joint(joint: JointImpedance) -> Json:
    quantities = {"inertia": joint.inertia, "damping": joint.damping, "stiffness": joint.stiffness}
    return {"posture_rad": joint.posture.tolist()} | {
        name: _quantity(q) for name, q in quantities.items() if q is not None
    }


def _quantity(quantity: Quantity) -> Json:
    return {"value": quantity.value.tolist(), "ci95": quantity.ci95.tolist(), "unit": quantity.unit}


def _keyed(keys: Sequence[str], values: Floats) -> dict[str, float]:
    return {key: float(value) for key, value in zip(keys, values, strict=True)}
