"""Uncertainty through a fit that is linear in the effects: covariance grows by A C A^T and nothing else."""

from collections.abc import Sequence

import numpy as np
import pytest
from impid_host.diagnosis.propagate import moved_fits
from impid_host.diagnosis.result import Chosen
from impid_host.impedance.linear import Estimate

from .synthetic import term

A = np.array([[2.0, -1.0, 0.5, 300.0], [0.0, 4.0, 1.0, -20.0]])
FIRST = np.array([7.0, -3.0])
OWN = np.array([[0.04, 0.01], [0.01, 0.09]])
CHOSEN = [
    Chosen(term("elastic.joint", "joint1", size=2), 0.0, np.array([3.0, -1.0]), np.eye(2)),
    # A non-linear parameter that the fit may change counts as one more.
    Chosen(
        term("actuator.cogging", "joint1", shapes=(1.0, 2.0)),
        1.4,
        np.array([0.2]),
        np.eye(2),
    ),
]
ROOT = np.array([[0.3, 0, 0, 0], [0.1, 0.2, 0, 0], [0, 0.05, 0.02, 0], [0.001, 0, 0.002, 0.004]])
COVARIANCE = ROOT @ ROOT.T


def estimate(value: np.ndarray) -> Estimate:
    return Estimate(("m", "b"), ("kg", "N*s/m"), value, OWN, np.zeros((0, 2, 2)), 100, np.ones(1), 1.0, (0,))


def parameters(chosen: Sequence[Chosen]) -> np.ndarray:
    spring, ripple = chosen
    return np.array([*spring.beta, *ripple.beta, ripple.shape])


def linear(chosen: Sequence[Chosen]) -> Estimate:
    return estimate(FIRST + A @ parameters(chosen))


@pytest.mark.parametrize("workers", [1, 2])
def test_a_linear_fit_is_widened_by_a_c_a_transposed(workers: int) -> None:
    steps, here, moved = moved_fits(CHOSEN, COVARIANCE, linear, workers)
    assert here.value == pytest.approx(FIRST + A @ [3.0, -1.0, 0.2, 1.4])
    wider = steps.wider(estimate(np.zeros(2)), here, moved)
    assert wider.covariance == pytest.approx(OWN + A @ COVARIANCE @ A.T, rel=1e-9)
    assert wider.value == pytest.approx(np.zeros(2))


def test_each_parameter_is_moved_by_its_standard_deviation_and_alone() -> None:
    seen: list[np.ndarray] = []

    def fit(chosen: Sequence[Chosen]) -> Estimate:
        seen.append(parameters(chosen))
        return linear(chosen)

    moved_fits(CHOSEN, COVARIANCE, fit, workers=1)
    steps = np.array(seen[1:]) - seen[0]
    assert steps == pytest.approx(np.diag(np.sqrt(np.diag(COVARIANCE))), abs=1e-12)


def test_what_is_known_exactly_widens_nothing() -> None:
    steps, here, moved = moved_fits(CHOSEN, np.zeros((4, 4)), linear, workers=1)
    assert np.all(steps.size > 0)
    assert steps.wider(here, here, moved).covariance == pytest.approx(OWN, rel=1e-12)


def test_the_slope_is_of_the_fit_at_the_effects_values() -> None:
    """y = e^b: a small uncertainty s of b makes one of e^b s (delta method), to the order of s."""

    def curved(chosen: Sequence[Chosen]) -> Estimate:
        return estimate(np.array([np.exp(chosen[0].beta[0]), 0.0]))

    s = 1e-4
    steps, here, moved = moved_fits(CHOSEN, np.diag([s**2, 0.0, 0.0, 0.0]), curved, workers=1)
    more = steps.wider(here, here, moved).covariance - OWN
    assert more[0, 0] == pytest.approx((np.exp(3.0) * s) ** 2, rel=2 * s)
    assert more[1] == pytest.approx(np.zeros(2), abs=1e-15)
