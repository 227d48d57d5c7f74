"""What is known from elsewhere, as rows worked out by hand."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from impid_host.diagnosis.base import Base, baseline, structure_of, textbook_structure
from impid_host.diagnosis.reference import reference_run, weighed
from impid_host.impedance.loads import load_model
from impid_host.robot.model import robot_model
from impid_host.robot.terms import robot_structure
from impid_host.study.model import RobotSetup, Setup, Study

MODEL = robot_model(RobotSetup("planar-2r-absolute", (0.254, 0.2667)))
BASE = Base(robot_structure(MODEL), (("A", load_model("mass-spring")), ("hand", load_model("arm"))))


def study(
    *, prior: tuple[float, ...] | None = None, tolerance: float = 0.002, **weights: tuple[float | None, ...]
) -> Study:
    trials = [
        SimpleNamespace(load=load, payload_kg=kg, kind="mass-spring")
        for load, own in weights.items()
        for kg in own
    ]
    setup = SimpleNamespace(prior_alpha=prior, tolerance=SimpleNamespace(payload_kg=tolerance))
    return cast(Study, SimpleNamespace(setup=setup, of_kind=lambda *_kinds: trials))


def test_a_payload_counts_where_all_trials_of_the_load_were_weighed_alike() -> None:
    assert weighed(study(A=(1.2, 1.2), B=(1.0, 1.1), C=(None, None), D=(0.0,))) == {"A": 1.2}


def test_nothing_known_is_no_row() -> None:
    assert reference_run(BASE, study(A=(None,))) is None


def test_a_weighed_load_is_a_row_on_its_mass() -> None:
    """1.2 kg +- hypot(2 g of the scales, 0.5 % of no two identifications' agreement)."""
    run = reference_run(BASE, study(A=(1.2,), hand=(2.0,)))
    assert run is not None
    sd = np.hypot(0.002, 0.006)
    assert run.target == pytest.approx([1.2 / sd])
    (row,) = run.base
    assert np.flatnonzero(row).tolist() == [5]
    assert row[5] == pytest.approx(1.0 / sd)


def test_a_prior_is_a_row_for_each_parameter_by_its_digits() -> None:
    prior = (0.07, 0.0421735, 0.0441628, 0.06510, 0.0739)
    run = reference_run(BASE, study(prior=prior))
    assert run is not None
    sd = np.diag(run.base[:, :5])
    assert run.target / sd == pytest.approx(prior)
    # Two digits: 0.005 to either side, uniform; six: what no two identifications agree in better.
    assert 1 / sd[0] == pytest.approx(np.hypot(0.005 * 0.07, 0.01 / np.sqrt(12)))
    assert 1 / sd[1] == pytest.approx(0.005 * 0.0421735, rel=1e-3)
    # Grease warms: friction by a tenth.
    assert 1 / sd[3] == pytest.approx(0.00651, rel=0.01)


def test_a_prior_of_another_robot_says_nothing() -> None:
    assert reference_run(BASE, study(prior=(0.1, 0.2))) is None


@pytest.mark.parametrize("more", [(), (0.3, 0.2, 0.0, 0.1)])
def test_a_prior_of_the_models_own_or_of_the_textbooks_parameters(more: tuple[float, ...]) -> None:
    """Six parameters are the robot's; dry friction and offsets are a record's, and no reference."""
    model = robot_model(RobotSetup("planar-2r-relative", (0.3, 0.25)))
    base = Base(textbook_structure(model), (("A", load_model("mass-spring")),))
    own = (0.1, 0.02, 0.05, 0.001, 0.08, 0.05)
    run = reference_run(base, study(prior=own + more))
    assert run is not None
    assert np.count_nonzero(run.base, axis=1).tolist() == [1] * 6
    assert run.target / np.diag(run.base[:, :6]) == pytest.approx(own)
    assert reference_run(base, study(prior=own[:5])) is None


@pytest.mark.parametrize(
    ("prior", "given", "start"),
    [(None, True, "textbook"), (6, False, "textbook"), (6, True, "papers"), (10, True, "textbook")],
)
def test_a_robot_that_is_given_is_what_the_prior_says(prior: int | None, given: bool, start: str) -> None:
    robot = RobotSetup("planar-2r-relative", (0.3, 0.25))
    setup = Setup(robot=robot, prior_alpha=None if prior is None else (0.1,) * prior)
    model = robot_model(robot)
    assert baseline(setup, model, given=given) == start
    wanted = textbook_structure(model) if start == "textbook" else robot_structure(model)
    assert structure_of(setup, model, given=given).parameter_names == wanted.parameter_names
