"""The estimators on the benchmark's closed forms: bias, intervals, and what `auto` makes of them."""

import estimator_cases
import numpy as np
import pytest
from impid_host.impedance.estimators.choose import Regression
from impid_host.impedance.estimators.estimated import EstimatorWish
from impid_host.impedance.estimators.instruments import controller
from impid_host.impedance.identify import LoadFit, RobotFit
from impid_host.impedance.rows import Split
from impid_host.signals.chain import DEFAULT


def fitted(case: estimator_cases.Case, wish: EstimatorWish) -> tuple[RobotFit, LoadFit]:
    assert case.load is not None
    regression = Regression(wish, DEFAULT, Split())
    robot = regression.robot(case.free, case.structure)
    known = robot.parameters
    return robot, regression.load(case.loaded, case.load[0], case.structure, known, known, 0.0)


def mean_error(kind: str, factor: float, wish: EstimatorWish, studies: int) -> np.ndarray:
    """Mean relative error of m, kxx and kyy."""
    errors = []
    for seed in range(studies):
        case = estimator_cases.paper(seed, factor, kind)
        assert case.load is not None
        errors.append((fitted(case, wish)[1].estimate.value / case.load[1] - 1)[:3])
    return np.asarray(np.mean(errors, axis=0))


def test_noise_of_25_times_the_usual_biases_least_squares_alone() -> None:
    plain = mean_error("mass-spring", 25.0, "least-squares", 12)
    instruments = mean_error("mass-spring", 25.0, "instruments", 12)
    assert plain[0] < -0.06 and plain[2] < -0.01
    # The mean of 12 has a standard error of 0.4 % in m.
    np.testing.assert_allclose(instruments, 0, atol=0.01)


@pytest.mark.parametrize(("factor", "expected"), [(1.0, "least-squares"), (25.0, "instruments")])
def test_auto_chooses_by_the_noise(factor: float, expected: str) -> None:
    case = estimator_cases.paper(1, factor, "mass-spring")
    fit = fitted(case, "auto")[1]
    assert fit.estimated is not None and fit.estimated.by == expected
    assert fit.estimated.bias_sd is not None and "least squares move" in fit.estimated.reason
    same = fitted(case, expected)[1]
    if expected == "least-squares":
        np.testing.assert_array_equal(fit.K.value, same.K.value)


def test_the_controller_is_found_in_the_record() -> None:
    case = estimator_cases.axis(3, 1.0, told=True)
    law = controller(case.free[0], case.structure, DEFAULT)
    assert law.stiffness[0, 0] == pytest.approx(-estimator_cases.KP, rel=0.05)
    assert law.damping[0, 0] == pytest.approx(-estimator_cases.KD, rel=0.05)


def test_a_reference_gives_the_simulated_model_as_instruments() -> None:
    case = estimator_cases.axis(3, 25.0, told=True)
    assert case.load is not None
    robot, fit = fitted(case, "instruments")
    assert robot.estimated is not None and robot.estimated.instruments == "simulated model"
    ci = fit.estimate.ci95
    # Intervals at 99.9 %: 1.7 times those at 95 %.
    assert np.all(np.abs(fit.estimate.value - case.load[1]) < 1.7 * 0.5 * (ci[:, 1] - ci[:, 0]))


def test_output_error_needs_no_accelerometer() -> None:
    case = estimator_cases.axis(4, 25.0)
    assert case.load is not None
    fit = fitted(case, "output-error")[1]
    assert fit.estimated is not None and fit.estimated.by == "output-error"
    np.testing.assert_allclose(fit.estimate.value, case.load[1], rtol=0.015)


def test_two_links_are_integrated_by_lagrange() -> None:
    # Energy of the frictionless arm under no torque, by the links' own formulas.
    q, s = np.array([[0.3, 0.8]]), np.array([[1.0, -2.0]])
    ec = estimator_cases
    a = ec._two_links(q, s, (ec.VISCOUS * s + ec.DRY * np.sign(s)))

    def energy(q: np.ndarray, s: np.ndarray) -> float:
        q1, q12, w1, w12 = q[0, 0], q.sum(), s[0, 0], s.sum()
        v2 = (ec.L1 * w1) ** 2 + (ec.C2 * w12) ** 2 + 2 * ec.L1 * ec.C2 * w1 * w12 * np.cos(q12 - q1)
        moving = 0.5 * (ec.M1 * (ec.C1 * w1) ** 2 + ec.M2 * v2 + ec.J1 * w1**2 + ec.J2 * w12**2)
        height = ec.M1 * ec.C1 * np.sin(q1) + ec.M2 * (ec.L1 * np.sin(q1) + ec.C2 * np.sin(q12))
        return float(moving + ec.GRAVITY * height)

    dt = 1e-4
    after = energy(q + dt * s + dt**2 / 2 * a, s + dt * a)
    before = energy(q - dt * s + dt**2 / 2 * a, s - dt * a)
    assert (after - before) / (2 * dt) == pytest.approx(0.0, abs=1e-5)
