"""Finite differences of a prediction whose derivative is known."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.effects.sensitivity import sensitivity
from impid_host.effects.view import Columns, View

from .closed_form import FREE, recorded

STEP = 1e-5
PLAIN = recorded(FREE)


def sines(view: View) -> Columns:
    return {"torque": np.sin(3 * view.theta), "force": view.theta**2}


def moved(joint: int) -> View:
    theta = PLAIN.theta.copy()
    theta[:, joint] += STEP
    return replace(PLAIN, theta=theta, response=None)


def test_each_column_is_the_derivative_by_one_error() -> None:
    """d sin(3 q) / dq = 3 cos(3 q), d q^2 / dq = 2 q, each on the joint that moved."""
    view = replace(PLAIN, respond=sines, response=None)
    found = sensitivity(view, STEP, moved(0), moved(1))
    assert set(found) == {"torque", "force"}
    for family, truth in (("torque", 3 * np.cos(3 * PLAIN.theta)), ("force", 2 * PLAIN.theta)):
        for joint in (0, 1):
            expected = np.zeros_like(truth)
            expected[:, joint] = truth[:, joint]
            # One-sided: half the step times the second derivative, at most 9.
            assert found[family][..., joint] == pytest.approx(expected, abs=5 * STEP)


def test_the_response_that_is_known_is_not_asked_for_again() -> None:
    asked: list[View] = []

    def respond(view: View) -> Columns:
        asked.append(view)
        return sines(view)

    known = replace(PLAIN, respond=respond, response=sines(PLAIN))
    other = moved(0)
    sensitivity(known, STEP, other)
    assert [view is other for view in asked] == [True]


def test_without_a_model_there_is_nothing_to_differentiate() -> None:
    assert sensitivity(replace(PLAIN, respond=None), STEP, moved(0)) == {}
