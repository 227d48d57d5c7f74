"""Reported parameters by the delta method, on closed forms; vectors there and back."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.diagnosis.parameters import at, count_of, holds_zero, joined, parameters_of, parted, vector_of
from impid_host.diagnosis.result import Chosen, Number
from impid_host.effects.catalogue import terms
from impid_host.effects.effect import Term

from ..effects.apparatus import apparatus


def find(effect: str, place: str, **of: object) -> Term:
    everything = terms(apparatus("all instruments").setting)
    return next(
        t
        for t in everything
        if t.effect == effect
        and place in t.where
        and t.when == "all"
        and all(getattr(t, k) == v for k, v in of.items())
    )


def number(found, name: str) -> Number:
    own = found[name]
    assert isinstance(own, Number)
    return own


def test_an_amplitude_and_its_phase_by_the_delta_method() -> None:
    """c, s = 0.3, 0.4: amplitude 0.5; its slope by (c, s) is (0.6, 0.8), the phase's (0.8, -0.6) / 0.5."""
    ripple = find("actuator.cogging", "joint1", own=())
    covariance = np.diag([1e-4, 4e-4, 1e-6])
    found = parameters_of(Chosen(ripple, 3.0, np.array([0.3, 0.4]), covariance))
    assert number(found, "amplitude").value == pytest.approx(0.5)
    assert number(found, "amplitude").half == pytest.approx(1.96 * np.sqrt(0.36e-4 + 0.64 * 4e-4), rel=1e-3)
    assert number(found, "phase_rad").half == pytest.approx(
        1.96 * np.sqrt(0.64e-4 + 0.36 * 4e-4) / 0.5, rel=1e-3
    )
    assert number(found, "cycles_per_rad").half == pytest.approx(1.96e-3, rel=1e-3)
    assert number(found, "amplitude").unit == "N*m"


def test_a_gain_is_the_inverse_of_one_and_its_error() -> None:
    gain = find("actuator.gain", "joint1", size=1)
    found = parameters_of(Chosen(gain, 0.0, np.array([0.25]), np.array([[1e-4]])))
    assert number(found, "gain").value == pytest.approx(0.8)
    assert number(found, "gain").half == pytest.approx(1.96 * 0.01 * 0.64, rel=1e-3)


def test_each_trial_has_its_own_number_by_its_name() -> None:
    here = apparatus("all instruments").setting
    drift = find("clock.drift", "sensor", size=len(here.trials))
    sd = np.linspace(1e-4, 4e-4, drift.size)
    found = parameters_of(Chosen(drift, 0.0, 1e-3 * np.arange(float(drift.size)), np.diag(sd**2)))
    own = found["seconds"]
    assert not isinstance(own, Number)
    assert tuple(own) == here.trials
    for k, name in enumerate(here.trials):
        assert own[name].value == pytest.approx(1e-3 * k)
        assert own[name].half == pytest.approx(1.96 * sd[k], rel=1e-3)


def test_two_joints_stand_side_by_side() -> None:
    parts = [
        Chosen(find("actuator.offset", f"joint{k}"), 0.0, np.array([0.1 * k]), np.array([[1e-6]]))
        for k in (1, 2)
    ]
    both = joined([parameters_of(part) for part in parts])
    assert number(both, "torque").value == pytest.approx([0.1, 0.2])
    assert number(both, "torque").ci95.shape == (2, 2)


def test_a_vector_there_and_back() -> None:
    ripple, dry = find("actuator.cogging", "joint1", own=()), find("friction.coulomb", "joint1")
    chosen = [
        Chosen(ripple, 3.0, np.array([0.3, 0.4]), np.eye(3)),
        Chosen(dry, dry.shapes[1], np.array([0.2]), np.eye(1)),
    ]
    # A ripple's frequency is fitted; how far a contact bends is too fine to be.
    assert [count_of(part) for part in chosen] == [3, 1]
    vector = vector_of(chosen)
    assert vector == pytest.approx([0.3, 0.4, 3.0, 0.2])
    moved = at(chosen, vector + np.array([0.1, 0.0, 1.0, -0.1]))
    assert moved[0].shape == 4.0 and moved[0].beta == pytest.approx([0.4, 0.4])
    assert moved[1].shape == dry.shapes[1] and moved[1].beta == pytest.approx([0.1])
    covariance = np.arange(16.0).reshape(4, 4)
    assert parted(covariance, chosen)[1].covariance.tolist() == [[15.0]]


@pytest.mark.parametrize(("value", "sd", "zero"), [(0.3, 0.1, False), (0.3, 0.2, True), (-0.3, 0.2, True)])
def test_an_amplitude_that_may_be_zero_is_told(value: float, sd: float, *, zero: bool) -> None:
    dry = find("friction.coulomb", "joint1")
    part = Chosen(dry, 0.0, np.array([value]), np.array([[sd**2]]))
    assert holds_zero(part) == zero
    assert not holds_zero(replace(part, term=find("actuator.offset", "joint1")))


def test_what_was_fitted_with_its_shape_held_has_no_error_of_the_shape() -> None:
    ripple = find("actuator.cogging", "joint1", own=())
    found = parameters_of(Chosen(ripple, 3.0, np.array([0.3, 0.4]), np.diag([1e-4, 4e-4])))
    assert number(found, "amplitude").half == pytest.approx(1.96 * np.sqrt(0.36e-4 + 0.64 * 4e-4), rel=1e-3)
    assert number(found, "cycles_per_rad").half == pytest.approx(0.0, abs=1e-12)
