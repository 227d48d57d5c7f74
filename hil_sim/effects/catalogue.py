"""Every effect that a scenario may hide, and how a scenario's table becomes one."""

from collections.abc import Mapping
from typing import Any

from hil_sim.effects import (
    accelerometer,
    actuator,
    clock,
    encoder,
    force_sensor,
    friction,
    geometry,
    load,
    outside,
    robot,
)
from hil_sim.effects.entry import Entry, Row, plant_effects
from hil_sim.errors import SimError
from hil_sim.world import TrialTruth

FAMILIES = (friction, robot, geometry, actuator, accelerometer, force_sensor, encoder, clock, load, outside)
ROWS: dict[str, Row] = {row.name: row for family in FAMILIES for row in family.EFFECTS}


def entry(
    effect: str,
    where: tuple[str, ...],
    trials: tuple[str, ...],
    given: Mapping[str, Any],
    *,
    when: str = "all",
    per_trial: Mapping[str, Mapping[str, Any]] | None = None,
) -> Entry:
    """A checked entry with every parameter.

    Args:
        effect: its name.
        where: its places; empty: the first that the catalogue has.
        trials: names of trials or loads that have it; empty: all.
        given: its parameters; those with a default may be left out.
        when: "all", "free" or "load".
        per_trial: parameters of single trials.

    Raises:
        SimError: there is no such effect, place or parameter, or one is missing.
    """
    if effect not in ROWS:
        raise SimError(f"effect {effect}: not known; use one of {', '.join(ROWS)}")
    row = ROWS[effect]
    places = where or row.places[:1]
    for place in places:
        if place not in row.places:
            raise SimError(f"effect {effect}: cannot be at {place}; where may be {', '.join(row.places)}")
    names = [parameter.name for parameter in row.parameters]
    for name in [*given, *(name for values in (per_trial or {}).values() for name in values)]:
        if name not in names:
            raise SimError(f"effect {effect}: has no parameter {name}; use {', '.join(names)}")
    if when not in ("all", "free", "load"):
        raise SimError(f"effect {effect}: when says {when}; give all, free or load, or name trials")
    values: dict[str, Any] = {}
    for parameter in row.parameters:
        value = given.get(parameter.name, parameter.default)
        if value is None:
            raise SimError(f"effect {effect}: {parameter.name} ({parameter.unit}) is missing; add it")
        if isinstance(value, str) != bool(parameter.words) or (
            parameter.words and value not in parameter.words
        ):
            wanted = " or ".join(parameter.words) if parameter.words else "a number or a list of numbers"
            raise SimError(f"effect {effect}: {parameter.name} says {value}; give {wanted}")
        values[parameter.name] = value
    return Entry(effect, places, trials, values, when, per_trial or {})


def applies(entry: Entry, trial: str, *, loaded: bool, load: str | None = None) -> bool:
    """Whether the effect is present in that trial, which has this load."""
    if not loaded and (ROWS[entry.effect].loaded_only or entry.when == "load"):
        return False
    if loaded and entry.when == "free":
        return False
    return not entry.trials or trial in entry.trials or load in entry.trials


def apply(truth: TrialTruth, entries: tuple[Entry, ...]) -> TrialTruth:
    """The truth of a trial with these effects in it, one after the other."""
    for one in entries:
        truth = ROWS[one.effect].apply(truth, one.in_trial(truth.name))
        alpha = truth.plant.alpha
        between = 0.5 * abs(alpha[1]) + abs(plant_effects(truth).inertia12)
        if min(alpha[0], alpha[2]) <= 0.0 or between**2 >= alpha[0] * alpha[2]:
            raise SimError(f"effect {one.effect}: leaves a link without inertia; make it smaller")
    return truth
