"""An effect of a random study: what its label says, and all else by chance.

A label is NAME, NAME@PLACE or NAME@PLACE+PLACE, then, if wanted, `:WHEN` (free, load, or names of trials or
loads joined by +), then `,KEY=NUMBER` for parameters that chance shall not decide:

    elastic.cartesian@tip:load
    outside.push@load:spring_L1_02,start_s=24
    force.scale@sensor,gain=1.05
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hil_sim.effects import catalogue
from hil_sim.effects.entry import Entry, Parameter
from hil_sim.effects.strength import neutral_of
from hil_sim.errors import SimError
from hil_sim.scenarios.schema import Scenario
from hil_sim.trials import without_effects
from hil_sim.world import TrialTruth

Values = dict[str, Any]
# Of an effect that is in one trial alone unless its label says otherwise: whether that is a loaded one.
IN_ONE_TRIAL = {"outside.one_trial": False, "outside.push": True}


def drawn(label: str, scenario: Scenario, rng: np.random.Generator) -> tuple[Entry, bool]:
    """The effect of that label at its ordinary size.

    Returns:
        The effect, and whether its label states its size, so that it is not for scaling.

    Raises:
        SimError: the label cannot be read, or names something that there is not.
    """
    name, where, when, fixed = _read(label)
    if name not in catalogue.ROWS:
        raise SimError(f"effect {name}: not known; use one of {', '.join(catalogue.ROWS)}")
    row = catalogue.ROWS[name]
    if row.needs_force_sensor and scenario.world.force_sensor is None:
        raise SimError(f"effect {name}: this laboratory has no force sensor; leave out --no-force-sensor")
    where = where or row.places[:1]
    truth = without_effects(scenario, scenario.trials[0], 0)
    given = {
        parameter.name: _value(parameter, where, rng, truth)
        for parameter in row.parameters
        if _is_drawn(name, parameter, where)
    }
    per_trial = PER_TRIAL[name](given, scenario, rng) if name in PER_TRIAL else {}
    if name == "load.coupling":
        skew = float(rng.choice([-1.0, 1.0])) * given["K"]
        given["K"] = [[0.0, skew], [-skew, 0.0]]
    for values in per_trial.values():
        for key in fixed:
            values.pop(key, None)
    given |= fixed
    kind, trials = _when(name, where, when, scenario, rng)
    entry = catalogue.entry(name, where, trials, given, when=kind, per_trial=per_trial)
    sizes = {parameter.name for parameter in row.parameters if parameter.neutral is not None}
    return entry, bool(sizes & set(fixed))


def _read(label: str) -> tuple[str, tuple[str, ...], tuple[str, ...], Values]:
    head, *pairs = label.split(",")
    place, _, when = head.partition(":")
    name, _, where = place.partition("@")
    fixed: Values = {}
    for pair in pairs:
        key, _, text = pair.partition("=")
        try:
            fixed[key] = float(text)
        except ValueError:
            raise SimError(f"effect {name}: cannot read {pair}; write PARAMETER=NUMBER") from None
    return name, tuple(filter(None, where.split("+"))), tuple(filter(None, when.split("+"))), fixed


def _is_drawn(name: str, parameter: Parameter, where: tuple[str, ...]) -> bool:
    if name == "inertia.extra":
        return parameter.name == _inertia_at(where)
    return parameter.drawn_word or bool(parameter.low or parameter.high)


def _inertia_at(where: tuple[str, ...]) -> str:
    """A mass at the tip, a rotor on one joint, or one that both joints turn: its own part is within alpha."""
    return "mass" if where == ("tip",) else "inertia" if len(where) == 1 else "coupling"


def _when(
    name: str, where: tuple[str, ...], when: tuple[str, ...], scenario: Scenario, rng: np.random.Generator
) -> tuple[str, tuple[str, ...]]:
    """The kind of trials, and their names where it is not all of a kind."""
    if when:
        if len(when) == 1 and when[0] in ("all", "free", "load"):
            return when[0], ()
        there = {trial.name for trial in scenario.trials} | {trial.load for trial in scenario.trials}
        for one in when:
            if one not in there:
                raise SimError(f"effect {name}: {one} is no trial or load; use free, load or a name")
        return "all", when
    if name in IN_ONE_TRIAL:
        among = [trial.name for trial in scenario.trials if (trial.load is not None) == IN_ONE_TRIAL[name]]
        return "all", (str(rng.choice(among)),)
    if name == "inertia.extra" and len(where) == 1:
        # In every trial it would be part of alpha, and no one could tell.
        return "load", ()
    return "all", ()


def _value(parameter: Parameter, where: tuple[str, ...], rng: np.random.Generator, truth: TrialTruth) -> Any:
    """One draw, or one for each place or axis."""
    if parameter.words:
        return str(rng.choice(parameter.words))
    neutral = np.zeros(()) if parameter.neutral is None else neutral_of(parameter, truth, where)
    each = np.broadcast_to(neutral, (len(where),))

    def one(place: int) -> float:
        value = float(rng.uniform(parameter.low, parameter.high))
        if callable(parameter.neutral):
            value += float(each[place])
        if parameter.signed and rng.random() < 0.5:
            value = 2.0 * float(each[place]) - value
        return value

    if parameter.pair:
        size, angle = one(0), float(rng.uniform(0.0, 2.0 * np.pi))
        return [size * float(np.cos(angle)), size * float(np.sin(angle))]
    if parameter.shared or len(where) == 1:
        return one(0)
    return [one(place) for place in range(len(where))]


# What differs from trial to trial by its nature.


def _drift_turns(given: Values, scenario: Scenario, rng: np.random.Generator) -> dict[str, Values]:
    """An arm that tires gives way in another direction each time."""
    size = float(np.hypot(*given["rate"]))
    turn = {trial.name: float(rng.uniform(0.0, 2.0 * np.pi)) for trial in scenario.trials if trial.load}
    return {name: {"rate": [size * np.cos(a).item(), size * np.sin(a).item()]} for name, a in turn.items()}


def _clock_wanders(given: Values, scenario: Scenario, rng: np.random.Generator) -> dict[str, Values]:
    """Warmth comes and goes as it likes: another bend, or another phase of a swing, in each trial."""
    if rng.random() < 0.5:
        given["seconds"] = 0.0
        return {trial.name: {"phase_rad": float(rng.uniform(0.0, 2.0 * np.pi))} for trial in scenario.trials}
    given["wander"] = 0.0
    size = abs(given["seconds"])
    turn = {trial.name: float(rng.uniform(0.0, 2.0 * np.pi)) for trial in scenario.trials}
    return {name: {"seconds": [size * np.cos(a).item(), size * np.sin(a).item()]} for name, a in turn.items()}


def _power_was_off(given: Values, scenario: Scenario, rng: np.random.Generator) -> dict[str, Values]:
    """In every other laboratory the drives were off between trials, and the ripple starts elsewhere."""
    if rng.random() < 0.5:
        return {}
    phases = rng.uniform(0.0, 2.0 * np.pi, (len(scenario.trials), np.size(given["phase_rad"])))
    return {
        trial.name: {"phase_rad": phase.tolist() if phase.size > 1 else float(phase[0])}
        for trial, phase in zip(scenario.trials, phases, strict=True)
    }


def _session(_: Values, scenario: Scenario, rng: np.random.Generator) -> dict[str, Values]:
    """Trials follow each other after half a minute or so, in the order of their names."""
    result, now = {}, 0.0
    for trial in scenario.trials:
        result[trial.name] = {"warm_for_s": round(now, 1)}
        now += trial.duration_s + float(rng.uniform(10.0, 50.0))
    return result


PER_TRIAL: Mapping[str, Callable[[Values, Scenario, np.random.Generator], dict[str, Values]]] = {
    "load.drift": _drift_turns,
    "clock.drift": _clock_wanders,
    "actuator.cogging": _power_was_off,
    "outside.torque_constant": _session,
}
