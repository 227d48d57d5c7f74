"""How clearly an effect shows: its part of the residuals against the noise floor.

The same trials are run with and without the effect, with the same chance. What a refit of the papers' model
would take up is taken off, because nobody can see it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects import catalogue
from hil_sim.effects.entry import Entry, Parameter
from hil_sim.effects.residuals import Residuals, residuals
from hil_sim.errors import SimError
from hil_sim.world import TrialTruth

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Clean:
    """A trial without effects, and what noise and quantisation leave there."""

    truth: TrialTruth
    residuals: Residuals

    @classmethod
    def of(cls, truth: TrialTruth) -> "Clean":
        """Runs the trial."""
        return cls(truth, residuals(truth, truth))


def strength(entries: tuple[Entry, ...], trials: list[Clean]) -> float:
    """The effects' visible part of the residuals over the noise floor, where it is clearest.

    Args:
        entries: the effects.
        trials: those that the strength refers to; free ones share alpha.
    """
    return max(ratio for ratios in by_channel(entries, trials) for ratio in ratios.values())


def by_channel(entries: tuple[Entry, ...], trials: list[Clean]) -> list[dict[str, float]]:
    """For each trial, rms of the effects' visible part over that of the noise floor, by channel."""
    hidden = [_with(entries, clean) for clean in trials]
    free = [k for k, clean in enumerate(trials) if "tau1" in clean.residuals.channel]
    result: list[dict[str, float]] = [{} for _ in trials]
    groups = [(free, ("tau1", "tau2"))] if free else []
    groups += [([k], ("fx", "fy")) for k in range(len(trials)) if k not in free]
    for group, names in groups:
        floors = _left([trials[k].residuals for k in group], names)
        effects = _left([hidden[k] for k in group], names)
        for k, floor, effect in zip(group, floors, effects, strict=True):
            result[k] |= {name: _rms(effect[c] - floor[c]) / _rms(floor[c]) for c, name in enumerate(names)}
    for k, clean in enumerate(trials):
        for name in ("fsx", "fsy", "a1", "a2"):
            if name in clean.residuals.channel:
                noise = clean.residuals.channel[name]
                result[k][name] = _rms(hidden[k].channel[name] - noise) / _rms(noise)
    return result


def _strength_or_inf(entry: Entry, trials: list[Clean]) -> float:
    """The strength; infinite where the effect is larger than any robot has it, or than control endures."""
    try:
        found = strength((entry,), trials)
    except SimError:
        return np.inf
    return found if np.isfinite(found) else np.inf


def _with(entries: tuple[Entry, ...], clean: Clean) -> Residuals:
    truth = clean.truth
    loaded = bool(truth.plant.load.M.any() or truth.plant.load.K.any())
    present = tuple(one for one in entries if catalogue.applies(one, truth.name, loaded=loaded))
    return residuals(catalogue.apply(truth, present), truth) if present else clean.residuals


def _left(trials: list[Residuals], names: tuple[str, str]) -> list[list[Array]]:
    """What a fit of the model's parameters to all these trials together leaves, by trial and channel."""
    stacked = np.concatenate([trial.channel[name] for trial in trials for name in names])
    columns = np.concatenate([trial.columns for trial in trials])
    left = stacked - columns @ np.linalg.lstsq(columns, stacked, rcond=None)[0]
    sizes = np.cumsum([trial.channel[name].size for trial in trials for name in names])[:-1]
    parts = np.split(left, sizes)
    return [parts[2 * k : 2 * k + 2] for k in range(len(trials))]


def scaled(entry: Entry, factor: float, truth: TrialTruth) -> Entry:
    """The effect made stronger: what departs from its absence departs by so many times.

    Args:
        entry: the effect.
        factor: by how much.
        truth: a trial of the laboratory, without effects.
    """

    def grown(values: Mapping[str, Any]) -> dict[str, Any]:
        result = dict(values)
        for parameter in catalogue.ROWS[entry.effect].parameters:
            if parameter.neutral is None or parameter.name not in values or parameter.words:
                continue
            away = np.asarray(values[parameter.name], dtype=np.float64)
            neutral = neutral_of(parameter, truth, entry.where)
            away = away - neutral
            more = away / factor if parameter.inverse else neutral + factor * away
            result[parameter.name] = more.tolist()
        return result

    per_trial = {name: grown(values) for name, values in entry.per_trial.items()}
    return replace(entry, values=grown(entry.values), per_trial=per_trial)


def neutral_of(parameter: Parameter, truth: TrialTruth, where: tuple[str, ...]) -> Array:
    """The value at which the effect is absent: one number, or one for each place.

    Raises:
        ValueError: the parameter does not say how large the effect is.
    """
    if parameter.neutral is None:
        raise ValueError(f"{parameter.name} has no value at which its effect is absent")
    if not callable(parameter.neutral):
        return np.asarray(parameter.neutral)
    each = [parameter.neutral(truth, place) for place in where]
    return np.asarray(each if len(each) > 1 else each[0])


def scaled_to(entry: Entry, wanted: float, trials: list[Clean]) -> tuple[Entry, float]:
    """The effect at the strength wanted, and the strength that was reached.

    Raises:
        SimError: the effect does not show at all in these trials, or cannot be so strong.
    """
    reached = strength((entry,), trials)
    if reached <= 0.0:
        raise SimError(f"effect {entry.effect}: does not show in these trials at all")
    factor, best = 1.0, (entry, reached)
    # The largest factor known to be too small with its strength, and the smallest known to be too large.
    below: tuple[float, float] | None = None
    above: tuple[float, float] | None = None
    for _ in range(8):
        if abs(reached / wanted - 1.0) < 0.1:
            break
        if reached < wanted:
            below = factor, reached
        else:
            above = factor, reached
        factor = _between(wanted, below, above)
        now = scaled(entry, factor, trials[0].truth)
        reached = _strength_or_inf(now, trials)
        if 0.0 < reached < np.inf and abs(np.log(reached / wanted)) < abs(np.log(best[1] / wanted)):
            best = now, reached
    return best


def _between(wanted: float, below: tuple[float, float] | None, above: tuple[float, float] | None) -> float:
    """The next factor to try: in proportion from one side, and by the power law between two."""
    if below is None or above is None:
        factor, reached = below or above or (1.0, wanted)
        # A clipped log shows nothing at all below its limit.
        return factor * float(np.clip(wanted / reached, 0.02, 50.0)) if reached > 0.0 else 2.0 * factor
    low, high = np.log(below[0]), np.log(above[0])
    share = 0.5
    if below[1] > 0.0 and np.isfinite(above[1]):
        share = np.log(wanted / below[1]) / np.log(above[1] / below[1])
    # Not too near to either end: a loop that has lost its stability has no power law.
    return float(np.exp(low + np.clip(share, 0.1, 0.9) * (high - low)))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
