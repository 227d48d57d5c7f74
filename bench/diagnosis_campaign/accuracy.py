"""How far numbers are from the truth: the robot and its loads before and after, the effects' own parameters."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from impid_host.diagnosis.result import Finding, Number, Stage
from numpy.typing import NDArray

from hil_sim.effects.catalogue import ROWS
from hil_sim.effects.entry import Entry
from hil_sim.scenarios.schema import Scenario
from hil_sim.trials import trial_truth

Json = dict[str, Any]
Array = NDArray[np.float64]
_BOTH_AXES = ("accel.scale", "accel.bias", "accel.cross_axis")


def bias(stage: Stage, scenario: Scenario) -> Json:
    """Of alpha and of every load's M and K: error in per cent of the truth, and in half-widths of the intervals.

    Several numbers are taken together as root mean squares: of relative errors for alpha, of errors over half
    an interval for all. A symmetric matrix counts each of its numbers once; of M = m 1 there is one. The truth
    is the whole of a load's mass and stiffness, with what hidden effects add to them.
    """
    alpha = np.array(scenario.world.robot.alpha)
    result = {"alpha": _compared(stage.alpha.value, stage.alpha.ci95, alpha, each=True)}
    for trial in scenario.trials:
        if trial.load is not None and trial.load in stage.loads:
            truth, load = trial_truth(scenario, trial, 0).plant.load, stage.loads[trial.load]
            for letter, matrix in (("M", truth.M), ("K", truth.K)):
                if letter in load:
                    result[letter] = _load(load[letter], matrix)
    return result


def _load(number: Number, truth: Array) -> Json:
    """Errors of a matrix' numbers, those that are the same by the load's model counted once."""
    rows, columns = [0, 0, 1], [0, 1, 1]
    if not all(np.array_equal(matrix, matrix.T) for matrix in (number.value, truth)):
        rows, columns = [0, 0, 1, 1], [0, 1, 0, 1]
    elif all(np.array_equal(matrix, matrix[0, 0] * np.eye(2)) for matrix in (number.value, truth)):
        rows, columns = [0], [0]
    return _compared(
        number.value[rows, columns], number.ci95[rows, columns], truth[rows, columns], each=False
    )


def _compared(value: Array, ci95: Array, truth: Array, *, each: bool) -> Json:
    """Percent of each number, or of all together; errors in half-widths; how many intervals cover."""
    error = value - truth
    half = 0.5 * (ci95[..., 1] - ci95[..., 0])
    known = half > 0
    size = np.abs(truth) if each else np.sqrt(np.mean(truth**2))
    return {
        "percent": float(100 * _rms(error / size)),
        "half_widths": float(_rms(error[known] / half[known])) if known.any() else None,
        "covered": int(np.sum(np.abs(error) <= half)),
        "of": int(error.size),
    }


def parameters(finding: Finding, entry: Entry) -> Json:
    """Of every parameter that both know, at the places that both name: relative error and coverage.

    Returns:
        name -> truth, found, relative (to the truth's distance from the effect's absence; None for phases and
        where that is zero), covered, of, and width, the intervals' mean half-width.
    """
    truth = true_values(entry, finding.parameters)
    neutral = {one.name: one.neutral or 0.0 for one in ROWS[entry.effect].parameters}
    result: Json = {}
    for name, number in finding.parameters.items():
        if name not in truth:
            continue
        pair = _matched(number, finding.where, truth[name], places(entry))
        if pair is None:
            continue
        found, ci95, true = pair
        error = found - true
        if name == "phase_rad":
            error = np.angle(np.exp(1j * error))
        half = 0.5 * (ci95[..., 1] - ci95[..., 0])
        centre = 0.5 * (ci95[..., 1] + ci95[..., 0]) - found
        size = float(np.linalg.norm(true - neutral.get(name, 0.0)))
        result[name] = {
            "truth": true.tolist(),
            "found": found.tolist(),
            "relative": float(np.linalg.norm(error) / size) if size and name != "phase_rad" else None,
            "covered": int(np.sum(np.abs(error + centre) <= half)),
            "of": int(error.size),
            "width": float(np.mean(half)),
        }
    return result


def places(entry: Entry) -> tuple[str, ...]:
    """Where it is; both axes of a sensor are the sensor."""
    return ("x", "y") if entry.effect in _BOTH_AXES and entry.where == ("sensor",) else entry.where


def true_values(entry: Entry, found: Mapping[str, Number]) -> Mapping[str, Array]:
    """The parameters as the report names them, one per place first, then components."""
    values = {
        name: np.asarray(value, dtype=np.float64)
        for name, value in entry.values.items()
        if not isinstance(value, str)
    }
    if entry.effect == "elastic.transmission":
        values["inertia_over_stiffness"] = values["motor_inertia"] / values["stiffness"]
    if entry.effect == "clock.drift" and "legendre" in found:
        hidden = values.pop("seconds")  # which is then from peak to peak
        values["legendre"] = np.zeros(found["legendre"].value.size)
        values["legendre"][: hidden.size] = hidden
    return values


def _matched(
    number: Number, found_at: Sequence[str], truth: Array, hidden_at: Sequence[str]
) -> tuple[Array, Array, Array] | None:
    """Found value, its interval and the truth, of the places that both name; None where shapes do not agree."""
    value, ci95 = number.value, number.ci95
    if len(found_at) > 1 and value.shape[:1] == (len(found_at),):
        both = [place for place in found_at if place in hidden_at]
        if not both:
            return None
        rows = [list(found_at).index(place) for place in both]
        value, ci95 = value[rows], ci95[rows]
    else:
        both = [place for place in found_at if place in hidden_at]
        if not both:
            return None
    if len(hidden_at) > 1 and truth.shape[:1] == (len(hidden_at),):
        truth = truth[[list(hidden_at).index(place) for place in both]]
    if truth.size == 1 and value.ndim == 2:
        truth = float(truth.ravel()[0]) * np.eye(value.shape[0])
    try:
        truth = np.broadcast_to(truth.reshape(()) if truth.size == 1 else truth, value.shape)
    except ValueError:
        return None
    return value, ci95, np.asarray(truth)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
