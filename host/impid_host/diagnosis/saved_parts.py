"""Effects and stages of a saved model: how they stand in the file, and what is read back."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from impid_host.diagnosis.result import Chosen, Number, Stage
from impid_host.effects.effect import Ranges
from impid_host.errors import InputError
from impid_host.robot.model import RobotModel
from impid_host.robot.terms import TERMS, RobotStructure, robot_structure
from impid_host.signals.arrays import Floats
from impid_host.study.toml_file import Table

Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class SavedEffect:
    """One part of an effect in the model: a term of the catalogue and its parameters.

    Attributes:
        when: in which trials it acts; own: trials or loads that have a value each.
        beta: (q,); shape: the non-linear parameter.
        covariance: of beta, and the shape where that was fitted, (k, k).
    """

    effect: str
    where: tuple[str, ...]
    variant: str
    when: str
    own: tuple[str, ...]
    shape: float
    beta: Floats
    covariance: Floats

    @property
    def label(self) -> str:
        """`name@place`."""
        return f"{self.effect}@{'+'.join(self.where)}"


@dataclass(frozen=True, slots=True)
class SavedStructure:
    """What the robot's parameters are multiplied with: the model, gravity beside it or not, terms by name."""

    terms: tuple[str, ...] = ()
    gravity: bool = False

    def of(self, model: RobotModel) -> RobotStructure:
        """The same for a study's robot."""
        return RobotStructure(model, robot_structure(model, self.terms).terms, self.gravity)


@dataclass(frozen=True, slots=True)
class SavedStage:
    """One model of a machine with all its numbers, to be judged on other records.

    Attributes:
        added: the effect that this stage has beyond the one before it, `name@place`; None for the first.
        alpha: (p,) in the order of the structure's names; load_values: by load, (q,); effects: all of them.
    """

    added: str | None
    structure: SavedStructure
    alpha: Floats
    load_values: Mapping[str, Floats]
    effects: tuple[SavedEffect, ...]


class PartTable(Table):
    """An effect's part in the file."""

    where: list[str]
    variant: str = ""
    when: str = "all"
    own: list[str] = Field(default_factory=list)
    shape: float
    beta: list[float] = Field(min_length=1)
    covariance: list[list[float]]

    def read(self, path: Path, effect: str) -> SavedEffect:
        """As it is used.

        Raises:
            InputError: its covariance is no square matrix.
        """
        covariance = np.array(self.covariance)
        if covariance.ndim != 2 or covariance.shape[0] != covariance.shape[1]:
            raise InputError(path, f"{effect}: its covariance is no square matrix", "write the model again")
        return SavedEffect(
            effect,
            tuple(self.where),
            self.variant,
            self.when,
            tuple(self.own),
            self.shape,
            np.array(self.beta),
            covariance,
        )


class EffectTable(Table):
    """An effect in the file: on several joints it has several parts."""

    effect: str
    parts: list[PartTable]

    def read(self, path: Path) -> list[SavedEffect]:
        """Its parts, as they are used."""
        return [part.read(path, self.effect) for part in self.parts]


class StructureTable(Table):
    """What stands beside the robot's model, in the file."""

    terms: list[str] = Field(default_factory=list)
    gravity: bool = False

    def read(self, path: Path) -> SavedStructure:
        """As it is used.

        Raises:
            InputError: a term that this version does not know.
        """
        unknown = [name for name in self.terms if name not in TERMS]
        if unknown:
            raise InputError(path, f"has a term {unknown[0]!r} that is not known", "write the model again")
        return SavedStructure(tuple(self.terms), self.gravity)


class StageTable(Table):
    """A stage in the file."""

    added: str | None = None
    structure: StructureTable = Field(default_factory=StructureTable)
    alpha: list[float]
    load_values: dict[str, list[float]] = Field(default_factory=dict)
    effects: list[EffectTable] = Field(default_factory=list)

    def read(self, path: Path) -> SavedStage:
        """As it is used."""
        loads = {name: np.array(values) for name, values in self.load_values.items()}
        effects = tuple(part for row in self.effects for part in row.read(path))
        return SavedStage(self.added, self.structure.read(path), np.array(self.alpha), loads, effects)


class NumberTable(Table):
    """A load's matrix or place in the file."""

    value: list[Any]
    ci95: list[Any]
    unit: str

    def read(self) -> Number:
        """As it is used."""
        return Number(np.array(self.value, dtype=float), np.array(self.ci95, dtype=float), self.unit)


class RangesTable(Table):
    """How far and fast the motion went, in the file."""

    span: list[float]
    speed: list[float]
    reach: float = 0.0
    duration_s: float

    def read(self) -> Ranges:
        """As it is used."""
        return Ranges(tuple(self.span), tuple(self.speed), self.reach, self.duration_s)


def part_json(part: Chosen) -> Json:
    """A part of an effect for the file."""
    return {
        "where": list(part.term.where),
        "variant": part.term.variant,
        "when": part.term.when,
        "own": list(part.term.own),
        "shape": part.shape,
        "beta": part.beta.tolist(),
        "covariance": part.covariance.tolist(),
    }


def structure_json(structure: RobotStructure) -> Json:
    """What stands beside the robot's model, for the file."""
    return {"terms": [term.name for term in structure.terms], "gravity": structure.gravity}


def values_json(structure: RobotStructure, alpha: Floats, loads: Mapping[str, Floats]) -> Json:
    """A model without effects, for the file."""
    return {
        "added": None,
        "structure": structure_json(structure),
        "alpha": alpha.tolist(),
        "load_values": {name: values.tolist() for name, values in loads.items()},
        "effects": [],
    }


def stage_json(stage: Stage, structure: RobotStructure) -> Json:
    """A stage of a diagnosis, for the file."""
    return values_json(structure, stage.alpha.value, stage.load_values) | {
        "added": None if stage.added is None else stage.added.label,
        "effects": _effects(stage.chosen),
    }


def _effects(chosen: Sequence[Chosen]) -> list[Json]:
    return [{"effect": part.term.effect, "parts": [part_json(part)]} for part in chosen if part.term.named]
