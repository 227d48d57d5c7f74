"""Trials for a tie: within what the robot may do, at rest where they should be."""

import numpy as np
import pytest
from impid_host.design.tie_motions import (
    Limits,
    Motion,
    Usual,
    columns_of,
    free_candidates,
    load_candidates,
    rests,
    reversals,
)
from impid_host.robot.model import robot_model
from impid_host.study.model import RobotSetup

MODEL = robot_model(RobotSetup("planar-2r-absolute", (0.254, 0.2667)))
USUAL = Usual(np.array([0.8, 0.7]), np.array([0.6, 0.5]), 2.0)
LIMITS = Limits(np.array([1.2, 1.0]), np.array([2.5, 2.5]), 14.0, 250.0, (0.5, 1.0))


def motions() -> list[Motion]:
    free = [own.motion for own in free_candidates(MODEL, USUAL, LIMITS)]
    loaded = [own.motion for own in load_candidates(MODEL, "A", USUAL, LIMITS, weighable=True)]
    return [own for own in (*free, *loaded) if own is not None]


def test_every_motion_keeps_to_the_limits_and_is_what_its_derivatives_say() -> None:
    found = motions()
    assert len(found) == 7 + 2 + 2
    for own in found:
        assert np.all(np.abs(own.theta - USUAL.centre).max(axis=0) <= 0.5 * LIMITS.range_rad * (1 + 1e-9))
        assert np.all(np.abs(own.omega).max(axis=0) <= LIMITS.speed * (1 + 1e-9))
        assert own.t[-1] <= LIMITS.duration_s + 1e-9
        assert np.all(np.abs(own.omega[[0, -1]]) < 0.05)
        slope = np.gradient(own.theta, own.t, axis=0)
        np.testing.assert_allclose(slope[2:-2], own.omega[2:-2], atol=0.02)
        inner = np.gradient(own.omega, own.t, axis=0)[2:-2] - own.theta_dd[2:-2]
        assert np.sqrt(np.mean(inner**2)) < 0.05 * np.sqrt(np.mean(own.theta_dd**2)) + 0.02


def test_rests_rest_two_seconds_at_places_that_span_the_range() -> None:
    own = rests(USUAL, LIMITS.range_rad, LIMITS)
    still = np.all(own.omega == 0, axis=1)
    assert still.mean() > 0.5
    places = np.unique(own.theta[still].round(6), axis=0)
    assert len(places) >= 4
    assert np.ptp(places[:, 0]) == pytest.approx(1.2)


def test_reversals_are_slower_than_a_radian_a_second() -> None:
    own = reversals(USUAL, LIMITS.range_rad, LIMITS)
    assert np.abs(own.omega).max() < 1.0
    assert np.sum(np.diff(np.sign(own.omega[:, 0])) != 0) >= 2


def test_the_columns_are_those_of_design_reference() -> None:
    own = rests(USUAL, LIMITS.range_rad, LIMITS)
    names = ["t", "theta1", "theta2", "omega1", "omega2", "theta_dd1", "theta_dd2"]
    assert list(columns_of(own)) == names
