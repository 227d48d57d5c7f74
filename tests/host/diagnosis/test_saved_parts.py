"""Parts of a saved model written as JSON text and read again are what they were, to the last digit."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impid_host.diagnosis.result import Chosen, Evidence, Finding, Number, Stage
from impid_host.diagnosis.saved_parts import (
    EffectTable,
    NumberTable,
    PartTable,
    RangesTable,
    StageTable,
    StructureTable,
    part_json,
    stage_json,
    structure_json,
)
from impid_host.errors import InputError
from impid_host.robot.model import robot_model
from impid_host.robot.terms import robot_structure
from impid_host.study.model import RobotSetup

from .synthetic import curve, term

FILE = Path("model.json")
STRUCTURE = robot_structure(
    robot_model(RobotSetup("planar-2r-absolute", (0.254, 0.2667), (0.0, 0.0), None)),
    ("friction.coulomb", "actuator.offset"),
)
RNG = np.random.default_rng(8)
SPRING = Chosen(
    term("elastic.joint", "joint2", size=2, variant="", when="load"),
    0.0,
    RNG.standard_normal(2),
    np.cov(RNG.standard_normal((2, 9))),
)
ZEROS = Chosen(
    term("force.bias", "x", "y", size=4, variant="drift each", own=("hand_01", "hand_02")),
    1 / 3,
    RNG.standard_normal(4),
    np.cov(RNG.standard_normal((5, 9))),
)


def through_text(document: object) -> dict[str, Any]:
    return json.loads(json.dumps(document))


@pytest.mark.parametrize("part", [SPRING, ZEROS], ids=lambda part: part.term.effect)
def test_a_part_comes_back_as_it_was(part: Chosen) -> None:
    saved = PartTable(**through_text(part_json(part))).read(FILE, part.term.effect)
    assert (saved.effect, saved.where) == (part.term.effect, part.term.where)
    assert (saved.variant, saved.when, saved.own) == (part.term.variant, part.term.when, part.term.own)
    assert saved.shape == part.shape
    assert np.array_equal(saved.beta, part.beta)
    assert np.array_equal(saved.covariance, part.covariance)
    assert saved.label == part.term.label


def stage() -> Stage:
    evidence = Evidence(0.5, 10.0, 1.0, 0.9)
    found = Finding("force.bias", ("x", "y"), (ZEROS,), {}, evidence)
    alpha = RNG.standard_normal(9)
    number = Number(alpha, np.stack([alpha - 1, alpha + 1], axis=1), "")
    nameless = Chosen(curve("tau1", "theta1"), 0.0, np.ones(4), np.eye(4))
    return Stage(
        found, {}, {}, number, (), {}, chosen=(SPRING, nameless, ZEROS), load_values={"hand": np.arange(3.0)}
    )


def test_a_stage_comes_back_with_its_names_and_without_what_has_none() -> None:
    here = stage()
    saved = StageTable(**through_text(stage_json(here, STRUCTURE))).read(FILE)
    assert saved.added == "force.bias@x+y"
    assert np.array_equal(saved.alpha, here.alpha.value)
    assert {name: values.tolist() for name, values in saved.load_values.items()} == {"hand": [0.0, 1.0, 2.0]}
    assert [row.label for row in saved.effects] == ["elastic.joint@joint2", "force.bias@x+y"]
    assert np.array_equal(saved.effects[1].beta, ZEROS.beta)
    assert saved.structure.of(STRUCTURE.model) == STRUCTURE


def test_the_structure_says_what_alpha_is_multiplied_with() -> None:
    saved = StructureTable(**through_text(structure_json(STRUCTURE))).read(FILE)
    again = saved.of(STRUCTURE.model)
    assert again.parameter_names == STRUCTURE.parameter_names
    assert saved.terms == ("friction.coulomb", "actuator.offset")


def test_an_effect_on_two_joints_has_two_parts() -> None:
    row = {"effect": "elastic.joint", "parts": [part_json(SPRING), part_json(SPRING)]}
    assert len(EffectTable(**through_text(row)).read(FILE)) == 2


def test_numbers_and_ranges_come_back() -> None:
    number = NumberTable(value=[[1, 2.5], [3, 4]], ci95=[[[0, 2]] * 2] * 2, unit="N/m").read()
    assert number.value.tolist() == [[1.0, 2.5], [3.0, 4.0]]
    assert number.half == pytest.approx(np.ones((2, 2)))
    ranges = RangesTable(span=[0.5, 0.6], speed=[1.0, 2.0], reach=0.1, duration_s=30.0).read()
    assert (ranges.span, ranges.speed, ranges.reach, ranges.duration_s) == ((0.5, 0.6), (1.0, 2.0), 0.1, 30.0)


@pytest.mark.parametrize("covariance", [[[1.0, 0.0]], [[1.0], [0.0]]])
def test_a_covariance_that_is_no_square_is_refused_by_name(covariance: list[list[float]]) -> None:
    row = part_json(SPRING) | {"covariance": covariance}
    with pytest.raises(InputError, match=r"model\.json.*elastic\.joint: its covariance is no square matrix"):
        PartTable(**through_text(row)).read(FILE, "elastic.joint")


def test_a_term_that_nobody_knows_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"model\.json.*'friction\.magic'"):
        StructureTable(terms=["friction.coulomb", "friction.magic"]).read(FILE)
