import numpy as np
import pytest
from impid_host.design.information import information
from impid_host.design.reference import (
    Plan,
    design_reference,
    low_crest_multisine,
    odd_random_multisine,
    ten_sinusoids,
)
from impid_host.errors import UndeterminedError
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute

MODEL = Planar2RAbsolute(0.254, 0.2667)
PLAN = Plan(
    centre=np.deg2rad([45.0, 45.0]),
    range_=np.deg2rad([40.0, 40.0]),
    period_s=20.0,
    periods=2,
    fade_s=3.0,
    fs=200.0,
)


def test_information_predicts_the_scatter_of_least_squares():
    rng = np.random.default_rng(1)
    Y = rng.standard_normal((300, 2, 3)) * np.array([1.0, 5.0, 0.2])
    torque_sd = np.array([0.5, 2.0])
    alpha = np.array([1.0, -2.0, 3.0])
    predicted = information(Y, torque_sd)
    A = (Y / torque_sd[:, None]).reshape(-1, 3)
    noise = rng.standard_normal((2000, 300, 2)) * torque_sd
    tau = ((Y @ alpha + noise) / torque_sd).reshape(2000, -1)
    estimates = np.linalg.lstsq(A, tau.T, rcond=None)[0]
    np.testing.assert_allclose(predicted.predicted_sd, estimates.std(axis=1), rtol=0.06)


def test_condition_and_determinant_of_a_known_regressor():
    # two columns at 60 degrees: normalised Gram matrix [[1, .5], [.5, 1]], singular values sqrt(1.5),
    # sqrt(.5)
    Y = np.array([[[1.0, 0.5]], [[0.0, np.sqrt(0.75)]]])
    result = information(Y, np.ones(1), size=np.array([2.0, 3.0]))
    assert result.condition == pytest.approx(np.sqrt(3))
    assert result.log_det == pytest.approx(np.log(0.75 * 36))
    dependent = information(np.ones((5, 1, 2)), np.ones(1))
    assert dependent.log_det == -np.inf
    assert np.all(np.isinf(dependent.predicted_sd))


def test_ten_sinusoids_stay_in_band_range_and_start_from_rest():
    reference = design_reference(MODEL, PLAN, ten_sinusoids(PLAN.period_s), candidates=5)
    for multisine in reference.multisines:
        assert len(multisine.harmonics) == 10
        assert len(set(multisine.harmonics.tolist())) == 10
        assert multisine.frequency_Hz.max() <= 2.0
    moved = reference.theta[reference.steady] - PLAN.centre
    # touches one end, stays inside both; a degree of slack for the grid between samples
    np.testing.assert_allclose(np.abs(moved).max(axis=0), np.deg2rad(20.0), atol=np.deg2rad(0.3))
    for end in (0, -1):
        np.testing.assert_allclose(reference.theta[end], PLAN.centre, atol=1e-12)
        np.testing.assert_allclose(reference.omega[end], 0.0, atol=1e-9)
        np.testing.assert_allclose(reference.theta_dd[end], 0.0, atol=1e-6)
    assert reference.t[-1] == pytest.approx(46.0)


def test_rates_are_the_derivatives_of_the_angles_through_fade_and_steady_part():
    reference = design_reference(MODEL, PLAN, odd_random_multisine(PLAN.period_s), candidates=1)
    omega = np.gradient(reference.theta, reference.t, axis=0)
    theta_dd = np.gradient(reference.omega, reference.t, axis=0)
    np.testing.assert_allclose(reference.omega[2:-2], omega[2:-2], atol=0.01 * np.abs(omega).max())
    np.testing.assert_allclose(reference.theta_dd[2:-2], theta_dd[2:-2], atol=0.01 * np.abs(theta_dd).max())


def test_steady_part_repeats_exactly():
    reference = design_reference(MODEL, PLAN, odd_random_multisine(PLAN.period_s), candidates=1)
    steady = reference.theta[reference.steady]
    assert len(steady) == 2 * 20 * 200
    np.testing.assert_allclose(steady[:4000], steady[4000:], atol=1e-12)


def test_more_candidates_never_tell_less_and_the_seed_decides():
    few = design_reference(MODEL, PLAN, ten_sinusoids(PLAN.period_s), candidates=1, seed=4)
    many = design_reference(MODEL, PLAN, ten_sinusoids(PLAN.period_s), candidates=8, seed=4)
    assert many.information.log_det >= few.information.log_det
    again = design_reference(MODEL, PLAN, ten_sinusoids(PLAN.period_s), candidates=8, seed=4)
    np.testing.assert_array_equal(many.theta, again.theta)


def test_low_crest_multisine_carries_more_power_within_the_same_limits():
    def power(choose):
        reference = design_reference(MODEL, PLAN, choose(PLAN.period_s), candidates=3)
        return np.mean((reference.theta[reference.steady] - PLAN.centre) ** 2)

    assert power(low_crest_multisine) > 1.3 * power(odd_random_multisine)


def test_impossible_wishes_are_refused():
    with pytest.raises(UndeterminedError, match="ten sinusoids need"):
        ten_sinusoids(2.0)
    slow = Plan(PLAN.centre, PLAN.range_, 20.0, 1, 2.0, 200.0, speed_limit=np.array([0.01, 0.01]))
    with pytest.raises(UndeterminedError, match="speed limit"):
        design_reference(MODEL, slow, ten_sinusoids(20.0), candidates=2)
    still = Plan(PLAN.centre, np.zeros(2), 20.0, 1, 2.0, 200.0)
    with pytest.raises(UndeterminedError, match="determines"):
        design_reference(MODEL, still, ten_sinusoids(20.0), candidates=2)
