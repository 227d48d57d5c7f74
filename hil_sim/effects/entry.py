"""What a row of the catalogue is, and what a scenario's table [[effects]] becomes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from hil_sim.errors import SimError
from hil_sim.plant.physics import PlantEffects, Term
from hil_sim.world import TrialTruth

JOINTS = ("joint1", "joint2")
AXES = ("x", "y")
Number = float | int
Value = Any  # a number, a pair, a matrix as list of lists, or a word


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes:
        name, unit: as diagnosis-format has them.
        low, high: what a random study draws it from, at strength one.
        neutral: the value at which the effect is absent, or how it follows from a trial and a place; None:
            the parameter says where or how, and is not scaled with the effect's strength. Where it is a
            function, `low` and `high` are departures from it.
        default: used when the scenario leaves it out; None: it must be given.
        words: what it may be, where it is not a number.
        signed: a random study may turn the departure from `neutral` round.
        pair: it has a component along x and one along y.
        inverse: the effect grows as one over it.
        shared: it is one value, however many places there are.
        drawn_word: a random study draws one of `words`; else it takes the default.
    """

    name: str
    unit: str
    low: float = 0.0
    high: float = 0.0
    neutral: "float | Neutral | None" = None
    default: Value = None
    words: tuple[str, ...] = ()
    signed: bool = False
    pair: bool = False
    inverse: bool = False
    shared: bool = False
    drawn_word: bool = False


Neutral = Callable[[TrialTruth, str], float]


@dataclass(frozen=True)
class Entry:
    """One [[effects]] table.

    Attributes:
        effect: which.
        where: its places.
        trials: names of the trials or loads that have it; empty: all that `when` allows.
        values: its parameters.
        when: "all", "free" or "load": the kind of trials that have it.
        per_trial: parameters that differ in the trials named.
    """

    effect: str
    where: tuple[str, ...]
    trials: tuple[str, ...]
    values: Mapping[str, Value]
    when: str = "all"
    per_trial: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)

    def in_trial(self, trial: str) -> "Entry":
        """The effect with the parameters that it has in this trial."""
        return replace(self, values={**self.values, **self.per_trial.get(trial, {})}, per_trial={})

    def each(self, name: str) -> list[float]:
        """The parameter, one number for each place in `where`."""
        value = self.values[name]
        if isinstance(value, (list, tuple)):
            if len(value) != len(self.where):
                raise SimError(
                    f"effect {self.effect}: {name} has {len(value)} values for {len(self.where)} places; "
                    "give one for each"
                )
            return [float(one) for one in value]
        return [float(value)] * len(self.where)

    def one(self, name: str) -> float:
        """The parameter as a single number."""
        value = self.values[name]
        if isinstance(value, (list, tuple)):
            raise SimError(f"effect {self.effect}: {name} must be one number, it says {value}")
        return float(value)

    def pair(self, name: str) -> tuple[float, float]:
        """The parameter along x and y: a single number stands for both."""
        value = self.values[name]
        pair = list(value) if isinstance(value, (list, tuple)) else [value, value]
        if len(pair) != 2:
            raise SimError(f"effect {self.effect}: {name} must be a number or a pair, it says {value}")
        return float(pair[0]), float(pair[1])

    def per_joint(self, name: str, absent: float = 0.0) -> tuple[float, float]:
        """The parameter for joints 1 and 2; `absent` for one where the effect is not."""
        given = dict(zip(self.where, self.each(name), strict=True))
        return given.get("joint1", absent), given.get("joint2", absent)

    def per_axis(self, name: str, absent: float = 0.0) -> tuple[float, float]:
        """The parameter for axes x and y; at "sensor" it holds for both, or is a pair."""
        if self.where == ("sensor",):
            return self.pair(name)
        given = dict(zip(self.where, self.each(name), strict=True))
        return given.get("x", absent), given.get("y", absent)

    @property
    def joints(self) -> list[int]:
        """Indices of the joints in `where`."""
        return [JOINTS.index(place) for place in self.where]


Apply = Callable[[TrialTruth, Entry], TrialTruth]


@dataclass(frozen=True)
class Row:
    """One effect of the catalogue.

    Attributes:
        name: as diagnosis-format has it; `outside.` for what is not on that list.
        says: what it does, as one line.
        places: what `where` may name; the first is the default.
        parameters: with units and ranges.
        apply: from the truth of a trial to that with this effect.
        loaded_only: it is part of the load, so free trials do not have it.
        needs_force_sensor: without a force sensor there is nothing that could err.
    """

    name: str
    says: str
    places: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    apply: Apply
    loaded_only: bool = False
    needs_force_sensor: bool = False


def plant_effects(truth: TrialTruth) -> PlantEffects:
    """What is hidden in this trial's plant so far."""
    return truth.plant.effects or PlantEffects()


def with_plant_effects(truth: TrialTruth, **changes: Any) -> TrialTruth:
    """The truth with these fields of PlantEffects replaced."""
    effects = replace(plant_effects(truth), **changes)
    return replace(truth, plant=replace(truth.plant, effects=effects))


def with_terms(truth: TrialTruth, terms: list[Term]) -> TrialTruth:
    """The truth with more torques that depend on an angle."""
    return with_plant_effects(truth, terms=(*plant_effects(truth).terms, *terms))


def added(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    """Element by element."""
    return one[0] + other[0], one[1] + other[1]


def refuse_relative(truth: TrialTruth, entry: Entry) -> None:
    """Ends with an error where the robot's second joint is relative: parts on it turn with the first link.

    Raises:
        SimError: this robot is so.
    """
    if truth.plant.relative:
        raise SimError(f"effect {entry.effect}: not modelled for planar-2r-relative; use planar-2r-absolute")


def with_alpha(truth: TrialTruth, more: Mapping[int, float]) -> TrialTruth:
    """The truth with so much added to the robot's parameters of these indices."""
    a = [value + more.get(index, 0.0) for index, value in enumerate(truth.plant.alpha)]
    return replace(truth, plant=replace(truth.plant, alpha=(a[0], a[1], a[2], a[3], a[4])))
