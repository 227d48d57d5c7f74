"""How far numbers are from the truth: the robot and its loads before and after, the effects' own parameters."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diagnosis_campaign.answer import Number, values
from diagnosis_campaign.answer import places as places_said
from hil_sim.effects.catalogue import ROWS
from hil_sim.effects.entry import Entry
from hil_sim.effects.strength import neutral_of
from hil_sim.scenarios.schema import Scenario
from hil_sim.trials import trial_truth
from hil_sim.world import TrialTruth

Json = dict[str, Any]
Array = NDArray[np.float64]
_BOTH_AXES = tuple(
    f"{sensor}.{error}" for sensor in ("accel", "force") for error in ("scale", "bias", "cross_axis")
)


def bias(stage: Json, scenario: Scenario) -> Json:
    """Of alpha and of every load's M and K: error in per cent of the truth, and in half-widths of the intervals.

    Several numbers are taken together as root mean squares: of relative errors for alpha, of errors over half
    an interval for all. A symmetric matrix counts each of its numbers once; of M = m 1 there is one. The truth
    is the whole of a load's mass and stiffness, with what hidden effects add to them.
    """
    alpha = np.array(scenario.world.robot.alpha)
    robot = Number.of(stage["parameters"]["alpha"])
    result = {"alpha": _compared(robot.value, robot.ci95, alpha, each=True)}
    loads = stage["parameters"].get("loads", {})
    for trial in scenario.trials:
        if trial.load in loads:
            truth = trial_truth(scenario, trial, 0).plant.load
            for letter, matrix in (("M", truth.M), ("K", truth.K)):
                if letter in loads[trial.load]:
                    result[letter] = _load(Number.of(loads[trial.load][letter]), matrix)
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
    known = (half > 0) & np.isfinite(half)
    size = np.abs(truth) if each else np.sqrt(np.mean(truth**2))
    return {
        "percent": float(100 * _rms(error / size)),
        "half_widths": float(_rms(error[known] / half[known])) if known.any() else None,
        "covered": int(np.sum(np.abs(error) <= half)),
        "of": int(error.size),
    }


def parameters(added: Json, entry: Entry, laboratory: TrialTruth) -> Json:
    """Of every parameter that both know, at the places that both name: relative error and coverage.

    Args:
        added: the finding.
        entry: the truth.
        laboratory: one of its trials, without effects.

    Returns:
        name -> truth, found, relative (to the truth's distance from the effect's absence; None for phases and
        where that is zero), covered, of, and width, the intervals' mean half-width. What is given trial by trial
        stands as name@trial.
    """
    result: Json = {}
    for name, trial, number in values(added["parameters"]):
        there = entry if trial is None else entry.in_trial(trial)
        truth = true_values(there, added["parameters"])
        # One number for all trials cannot be compared with one for each.
        differs = trial is None and any(name in given for given in entry.per_trial.values())
        if name not in truth or differs:
            continue
        said, hidden = places_said(added), places(entry)
        pair = _matched(number, said, truth[name], hidden)
        if pair is not None:
            away = _matched(number, said, truth[name] - _absent(entry, name, laboratory), hidden)
            row = _compared_one(name, *pair, size=float(np.linalg.norm(pair[2] if away is None else away[2])))
            result[name if trial is None else f"{name}@{trial}"] = row
    return result


def _absent(entry: Entry, name: str, laboratory: TrialTruth) -> Array:
    """The value of a parameter at which the effect is not there; zero where it does not say how large it is."""
    for one in ROWS[entry.effect].parameters:
        if one.name == name and one.neutral is not None:
            return neutral_of(one, laboratory, entry.where)
    return np.zeros(())


def _compared_one(name: str, found: Array, ci95: Array, true: Array, *, size: float) -> Json:
    error = found - true
    if name == "phase_rad":
        error = np.angle(np.exp(1j * error))
    half = 0.5 * (ci95[..., 1] - ci95[..., 0])
    centre = np.where(np.isfinite(half), 0.5 * (ci95[..., 1] + ci95[..., 0]) - found, 0.0)
    return {
        "truth": true.tolist(),
        "found": found.tolist(),
        "relative": float(np.linalg.norm(error) / size) if size and name != "phase_rad" else None,
        "covered": int(np.sum(np.abs(error + centre) <= half)),
        "of": int(error.size),
        "width": float(np.mean(half)),
    }


def places(entry: Entry) -> tuple[str, ...]:
    """Where it is; both axes of a sensor are the sensor."""
    return ("x", "y") if entry.effect in _BOTH_AXES and entry.where == ("sensor",) else entry.where


def true_values(entry: Entry, found: Mapping[str, Json]) -> Mapping[str, Array]:
    """The parameters as the report names them, one per place first, then components."""
    given = {
        name: np.asarray(value, dtype=np.float64)
        for name, value in entry.values.items()
        if not isinstance(value, str)
    }
    if entry.effect == "elastic.transmission":
        given["inertia_over_stiffness"] = given["motor_inertia"] / given["stiffness"]
    if entry.effect == "clock.drift" and "legendre" in found:
        hidden = np.atleast_1d(given.pop("seconds"))  # which is then from peak to peak
        said = found["legendre"]["value"]
        size = np.size(next(iter(said.values())) if isinstance(said, dict) else said)
        given["legendre"] = np.zeros(max(size, hidden.size))
        given["legendre"][: hidden.size] = hidden
    return given


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
