"""Parameters that are not linear, recovered from signals into which they were put exactly."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.diagnosis.case import Case
from impid_host.diagnosis.holdout import Holdout
from impid_host.diagnosis.refit import refit
from impid_host.diagnosis.result import Chosen
from impid_host.effects.catalogue import terms
from impid_host.effects.view import FAMILIES

from ..effects.apparatus import apparatus, by_name

TAPS = {(family, channel): np.full(1, 1e3) for family in FAMILIES for channel in (0, 1)}


def case_of(changes) -> Case:
    """Free motion and a spring; a trial of the case is `changes(view)`."""
    here = apparatus("all instruments")
    views = tuple(changes(by_name(here.views, name)) for name in ("free_01", "spring_A_01"))
    names = tuple(view.name for view in views)
    return Case(views, here.base, Holdout(names, ()), here.setting, None, ())


def term(effect: str, place: str, **of: object):
    return next(
        t
        for t in terms(apparatus("all instruments").setting)
        if t.effect == effect
        and place in t.where
        and t.when == "all"
        and all(getattr(t, k) == v for k, v in of.items())
    )


def test_a_ripple_between_two_frequencies_of_the_grid() -> None:
    ripple = term("actuator.cogging", "joint1", own=())
    shape = 0.5 * (ripple.shapes[7] + ripple.shapes[8])

    def changes(view):
        tau = view.tau.copy()
        tau[:, 0] += 0.03 * np.cos(2 * np.pi * shape * view.theta[:, 0] - 0.4)
        return replace(view, tau=tau)

    start = Chosen(ripple, ripple.shapes[7], np.array([0.02, 0.0]), np.eye(3))
    found = refit(case_of(changes), [start], TAPS)
    (part,) = found.chosen
    assert part.shape == pytest.approx(shape, rel=1e-4)
    assert np.hypot(*part.beta) == pytest.approx(0.03, rel=1e-3)
    assert np.arctan2(part.beta[1], part.beta[0]) == pytest.approx(0.4, abs=1e-2)


def test_a_late_log_beyond_the_first_order() -> None:
    """12 ms at 2 Hz: the first order alone is 0.7 % off, and leaves (w T)^2 / 2 of the torque."""
    delay = term("actuator.delay", "joint1", size=1)
    both = next(
        t
        for t in terms(apparatus("all instruments").setting)
        if t.effect == "actuator.delay" and len(t.where) > 1
    )

    def changes(view):
        late = np.stack([np.interp(view.t - 0.012, view.t, column) for column in view.tau.T], axis=1)
        return replace(view, tau=late)

    found = refit(case_of(changes), [Chosen(both, 0.0, np.array([0.010]), np.eye(1))], TAPS)
    assert found.chosen[0].beta[0] == pytest.approx(0.012, abs=2e-5)
    assert delay.undo is not None


def test_the_robot_and_the_load_beside_it_are_the_true_ones() -> None:
    here = apparatus("all instruments")
    dry = term("friction.quadratic", "joint2")

    def changes(view):
        tau = view.tau.copy()
        tau[:, 1] += 0.05 * view.omega[:, 1] * np.abs(view.omega[:, 1])
        return replace(view, tau=tau)

    found = refit(case_of(changes), [Chosen(dry, 0.0, np.array([0.03]), np.eye(1))], TAPS)
    assert found.chosen[0].beta[0] == pytest.approx(0.05, rel=1e-3)
    assert found.base[: here.base.robot] == pytest.approx(here.views[0].alpha, abs=1e-4)
    load = found.base[here.base.slot("spring_A")]
    # 1 kg, 300 and 200 N/m, 10 N/m across.
    assert load[:4] == pytest.approx([1.0, 300.0, 200.0, 10.0], rel=1e-2)


def test_with_nothing_chosen_the_base_alone_is_fitted() -> None:
    here = apparatus("all instruments")
    found = refit(case_of(lambda view: view), [], TAPS)
    assert found.chosen == ()
    assert found.base[: here.base.robot] == pytest.approx(here.views[0].alpha, abs=1e-5)
