"""The robot behind the loads: from free trials, from what a force sensor leaves of loads, or a prior."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.diagnosis.base import base_of, textbook_structure
from impid_host.diagnosis.own_robot import estimate_robot, given_robot, shows_robot, without_load
from impid_host.diagnosis.proof import aligned
from impid_host.errors import UndeterminedError
from impid_host.impedance.linear import Stretch
from impid_host.robot.model import robot_model
from impid_host.robot.terms import robot_structure
from impid_host.signals.chain import DEFAULT
from impid_host.study.model import RobotSetup

from ..effects.apparatus import apparatus
from ..effects.closed_form import FREE, HAND, SPRING, body, recorded

SLIDE = robot_structure(robot_model(RobotSetup("slide-1d", (), (0.0, 0.0), None)))
CHAIN = replace(DEFAULT, ar_order=0)
NOISE = 0.2


@pytest.mark.parametrize("trial", [SPRING, HAND])
def test_less_the_sensors_force_the_torque_is_the_robots_own(trial: str) -> None:
    view = recorded(trial)
    own = without_load(view, aligned(view))
    assert own.tau == pytest.approx(body(view.t).own(), abs=1e-9)
    unmeasured = replace(aligned(view), force=None)
    assert without_load(view, unmeasured) is unmeasured


def test_free_trials_come_first_then_all_loads_on_a_sensor_then_nothing() -> None:
    pairs = [(view, aligned(view)) for view in map(recorded, (FREE, SPRING, HAND))]
    assert [view.name for view, _ in shows_robot(pairs)] == [FREE]
    loaded = shows_robot(pairs[1:])
    assert [view.name for view, _ in loaded] == [SPRING, HAND]
    for view, trial in loaded:
        assert trial.tau == pytest.approx(body(view.t).own(), abs=1e-9)
    half = [pairs[1], (pairs[2][0], replace(pairs[2][1], force=None))]
    assert shows_robot(half) == []


def rows(acc: np.ndarray, speed: np.ndarray, seed: int) -> list[Stretch]:
    """12 kg and 30 N s/m, white noise."""
    design = np.stack([acc, speed], axis=1)[:, None, :]
    noise = NOISE * np.random.default_rng(seed).standard_normal((len(acc), 1))
    return [Stretch(design, design @ [12.0, 30.0] + noise)]


def test_where_everything_shows_every_parameter_is_estimated() -> None:
    t = np.arange(0, 40, 0.05)
    acc, speed = -np.sin(1.7 * t), np.cos(0.9 * t)
    found = estimate_robot(rows(acc, speed, 1), SLIDE, CHAIN)
    X = np.stack([acc, speed], axis=1)
    sd = NOISE * np.sqrt(np.diag(np.linalg.inv(X.T @ X)))
    assert np.abs(found.value - [12.0, 30.0]).max() < 4 * sd.max()
    assert found.sd == pytest.approx(sd, rel=0.25)
    assert found.names == SLIDE.parameter_names


def test_what_only_shows_together_is_told_together() -> None:
    """A motion whose speed is a third of its acceleration shows m + b / 3 = 22 and nothing of b alone."""
    acc = np.sin(1.7 * np.arange(0, 40, 0.05))
    found = estimate_robot(rows(acc, acc / 3, 2), SLIDE, CHAIN)
    m, b = SLIDE.parameter_names
    assert found.names == (f"{m} + 0.3333*{b}", f"{b} (not determined)")
    sd = NOISE / np.sqrt(acc @ acc)
    assert found.value == pytest.approx([22.0, 0.0], abs=4 * sd)
    assert found.covariance[1] == pytest.approx(np.zeros(2))
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(sd, rel=0.25)
    assert found.units == SLIDE.parameter_units


def test_rows_that_show_nothing_are_refused() -> None:
    still = np.zeros(800)
    with pytest.raises(UndeterminedError, match="nothing moves"):
        estimate_robot(rows(still, still, 3), SLIDE, CHAIN)


def test_a_robot_that_no_trial_shows_is_the_prior_or_refused() -> None:
    base = base_of([recorded(HAND)], robot_structure(recorded(HAND).model))
    prior = [0.07, 0.04, 0.04, 0.06, 0.07]
    robot = given_robot(base, prior)
    assert (robot.value.tolist(), robot.origin) == (prior, "prior")
    assert not robot.covariance.any()
    with pytest.raises(UndeterminedError, match=r"alpha of 5 values .* so the robot is unknown"):
        given_robot(base, None)
    with pytest.raises(UndeterminedError, match=r"\[prior\] has 3"):
        given_robot(base, prior[:3])
    more = base_of([recorded(HAND)], textbook_structure(recorded(HAND).model))
    with pytest.raises(UndeterminedError, match="alpha of 9 values"):
        given_robot(more, prior)


def test_a_torque_sensor_carries_no_robot() -> None:
    base = apparatus("torque at the load").base
    assert base.bare
    robot = given_robot(base, None)
    assert robot.origin == "none"
    assert not robot.value.any()
