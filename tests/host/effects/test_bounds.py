"""Bounds of the catalogue's parameters, on terms of a known apparatus."""

import numpy as np
import pytest
from impid_host.effects.bounds import on_its_bound, possible
from impid_host.effects.catalogue import terms

from .apparatus import apparatus

HERE = apparatus("all instruments")


def ripple():
    return next(t for t in terms(HERE.setting) if t.effect == "friction.position" and "joint1" in t.where)


def test_a_ripple_longer_than_what_was_visited_is_impossible() -> None:
    span = float(HERE.setting.span[0])
    beta = np.array([0.1, 0.05])
    assert max(ripple().shapes) == pytest.approx(1.2 * span)
    assert possible(ripple(), beta, 1.1 * span)
    assert not possible(ripple(), beta, 1.25 * span)


def test_a_period_that_was_stopped_by_its_bound_is_not_determined() -> None:
    span = float(HERE.setting.span[0])
    beta = np.array([0.1, 0.05])
    assert on_its_bound(ripple(), beta, 1.19 * span)
    assert not on_its_bound(ripple(), beta, 0.9 * span)
    # Beyond it is another matter, and said elsewhere.
    assert not on_its_bound(ripple(), beta, 1.25 * span)


def test_what_has_no_non_linear_parameter_has_no_such_bound() -> None:
    offset = next(t for t in terms(HERE.setting) if t.effect == "actuator.offset")
    assert not on_its_bound(offset, np.zeros(offset.size), 0.0)
