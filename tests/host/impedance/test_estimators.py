"""Instruments, output error and the simulated model against algebra, closed forms, an independent plant."""

from collections.abc import Callable

import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import Options, fit_study
from impid_host.impedance.estimators.plant import Law, Machines, integrate
from impid_host.impedance.identify import RobotFit
from impid_host.impedance.linear import Stretch, fit_linear
from impid_host.impedance.loads import arm
from impid_host.robot.joint_1d import Joint1D
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.robot.terms import RobotStructure
from impid_host.study.model import RobotLog, RobotSetup, Setup, Study, Trial

from .plant import ALPHA, L1, L2, Load, mass_matrix, slope, tip, velocity_terms

NAMES, UNITS = ("b", "k"), ("N*s/m", "N/m")


def noisy(rng: np.random.Generator, count: int, size: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Design, target and instruments of y = 3 x1 - 2 x2 with noise in x1 of a variance `size` squared."""
    true = np.stack([np.sin(0.07 * np.arange(count)), np.cos(0.11 * np.arange(count))], axis=1)
    error = np.stack([rng.normal(0, size, count), np.zeros(count)], axis=1)
    other = np.stack([rng.normal(0, size, count), np.zeros(count)], axis=1)
    target = true @ [3.0, -2.0] + rng.normal(0, 0.1, count)
    return (true + error)[:, None], target[:, None], (true + other)[:, None]


def test_instruments_are_the_textbook_formula() -> None:
    X, y, Z = noisy(np.random.default_rng(1), 4000, 0.5)
    found = fit_linear([Stretch(X, y, None, Z)], NAMES, UNITS, ar_order=0)
    by_hand = np.linalg.solve(Z[:, 0].T @ X[:, 0], Z[:, 0].T @ y[:, 0])
    np.testing.assert_allclose(found.value, by_hand, rtol=1e-10)
    np.testing.assert_allclose(found.value, [3.0, -2.0], atol=5 * found.sd.max())
    # Noise of variance s^2 beside a sine of power 1/2 leaves 0.5 / (0.5 + s^2) of the parameter.
    plain = fit_linear([Stretch(X, y)], NAMES, UNITS, ar_order=0)
    assert plain.value[0] == pytest.approx(3.0 * 0.5 / 0.75, rel=0.03)
    assert found.least_squares is not None
    np.testing.assert_allclose(found.least_squares[0], plain.value - found.value, atol=1e-10)
    assert abs(found.least_squares[0, 0]) > 10 * found.least_squares[1, 0]


def test_the_design_as_its_own_instrument_is_least_squares() -> None:
    X, y, _ = noisy(np.random.default_rng(2), 900, 0.1)
    slopes = np.random.default_rng(3).normal(size=(900, 1, 1))
    size = np.array([[0.04]])
    plain = fit_linear([Stretch(X, y, slopes)], NAMES, UNITS, nuisance_covariance=size)
    own = fit_linear([Stretch(X, y, slopes, X)], NAMES, UNITS, nuisance_covariance=size)
    np.testing.assert_allclose(own.value, plain.value, rtol=1e-9)
    np.testing.assert_allclose(own.covariance, plain.covariance, rtol=1e-6)
    assert plain.least_squares is None


@pytest.mark.parametrize("ar_order", [0, 8])
def test_intervals_by_instruments_hold_under_noise_in_the_design(ar_order: int) -> None:
    inside = []
    for seed in range(200):
        X, y, Z = noisy(np.random.default_rng(seed), 600, 0.4)
        ci = fit_linear([Stretch(X, y, None, Z)], NAMES, UNITS, ar_order=ar_order).ci95
        inside.append((ci[:, 0] <= [3.0, -2.0]) & (ci[:, 1] >= [3.0, -2.0]))
    # 400 intervals: a true 95 % has a standard error of 1.1 %.
    assert 0.92 <= np.mean(inside) <= 0.98


def test_the_simulated_model_swings_as_the_formula_says() -> None:
    # 0.02 kg m^2, 0.1 N m s/rad and 8 N m/rad let go at 0.3 rad.
    law = Law(1e-3, np.zeros((2000, 1)), np.zeros((1, 1)), np.zeros((1, 1)))
    alpha, value = np.array([[0.005, 0.04]]), np.array([[0.015, 0.06, 8.0, 0.0]])
    machine = Machines(RobotStructure(Joint1D()), alpha, arm(("theta",)), value)
    theta, omega = integrate(machine, [law], [(np.array([[0.3]]), np.zeros((1, 1)))])[0]
    decay, w = 0.1 / 0.04, np.sqrt(8.0 / 0.02 - (0.1 / 0.04) ** 2)
    expected = 0.3 * np.exp(-decay * law.t) * (np.cos(w * law.t) + decay / w * np.sin(w * law.t))
    np.testing.assert_allclose(theta[0, :, 0], expected, atol=3e-5)
    speed = -0.3 * np.exp(-decay * law.t) * (w + decay**2 / w) * np.sin(w * law.t)
    np.testing.assert_allclose(omega[0, :, 0], speed, atol=1e-3)


def test_the_simulated_arm_obeys_lagrange() -> None:
    rng = np.random.default_rng(4)
    theta, omega, tau = rng.uniform(0.4, 1.2, (5, 2)), rng.normal(0, 2, (5, 2)), rng.normal(0, 3, (5, 2))
    load = Load(B=((9.0, 1.0), (2.0, 6.0)))
    model = arm()
    K, B = np.array(load.K), np.array(load.B)
    value = np.concatenate([load.m * np.eye(2).ravel(), B.ravel(), K.ravel(), K @ load.x0])
    machines = Machines(
        RobotStructure(Planar2RAbsolute(L1, L2)), np.tile(ALPHA, (5, 1)), model, np.tile(value, (5, 1))
    )
    found = machines.accelerations(theta, omega, tau)
    J, x = slope(tip, theta), tip(*theta.T).T
    force = np.einsum("ij,nj->ni", K, x - np.array(load.x0)) + np.einsum("ij,njk,nk->ni", B, J, omega)
    left = tau - velocity_terms(theta, omega, load.m) - ALPHA[3:] * omega - np.einsum("nji,nj->ni", J, force)
    expected = np.linalg.solve(mass_matrix(theta, load.m), left[:, :, None])[:, :, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_what_nothing_holds_runs_away_in_words() -> None:
    law = Law(1e-2, np.full((3000, 1), 1e3), np.zeros((1, 1)), np.zeros((1, 1)))
    machine = Machines(RobotStructure(Joint1D()), np.array([[0.01, 0.0]]))
    with pytest.raises(UndeterminedError, match="nothing holds it"):
        integrate(machine, [law], [(np.zeros((1, 1)), np.zeros((1, 1)))])


def ankle(noise_nm: float, *, free: bool = False) -> Study:
    """One joint in closed form: 0.02 kg m^2, 0.9 N m s/rad, 60 N m/rad at 0.1 rad, a multisine, no module."""
    rng = np.random.default_rng(7)
    t = np.arange(0, 20, 2e-3)
    w, angle = 2 * np.pi * rng.uniform(0.2, 4.0, 12), rng.uniform(0, 2 * np.pi, 12)
    wave = 0.02 * np.exp(1j * (t[:, None] * w + angle))
    theta, omega, acc = (np.real((wave * (1j * w) ** k).sum(axis=1)) for k in range(3))
    J, B, K = (0.02, 0.9, 0.0) if free else (0.02, 0.9, 60.0)
    tau = J * acc + B * omega + K * (theta - 0.1) + rng.normal(0, noise_nm, len(t))
    log = RobotLog(t, theta[:, None], tau[:, None])
    trial = Trial("free_01" if free else "arm_01", "free" if free else "arm", "limb", log)
    return Study("ankle", Setup(RobotSetup("joint-1d")), (trial,))


def test_output_error_finds_a_limb_without_noise() -> None:
    fit = fit_study(ankle(0.0), Options(estimator="output-error")).loads[0]
    assert fit.estimated is not None and fit.estimated.by == "output-error"
    np.testing.assert_allclose(fit.estimate.value, [0.02, 0.9, 60.0, 6.0], rtol=2e-3)


def test_instruments_are_refused_where_there_are_none_and_auto_says_so() -> None:
    study = ankle(0.05)
    with pytest.raises(UndeterminedError, match="theta1_ref"):
        fit_study(study, Options(estimator="instruments"))
    auto, plain = (fit_study(study, Options(estimator=wish)).loads[0] for wish in ("auto", "least-squares"))
    assert auto.estimated is not None and auto.estimated.by == "least-squares"
    assert "cannot be compared" in auto.estimated.reason
    np.testing.assert_array_equal(auto.estimate.value, plain.estimate.value)
    assert plain.estimated is None


def test_output_error_of_a_free_robot_without_reference_is_not_pretended() -> None:
    robot = fit_study(ankle(0.05, free=True), Options(estimator="output-error")).robot
    assert isinstance(robot, RobotFit) and robot.estimated is not None
    assert robot.estimated.by == "least-squares" and "drifts away" in robot.estimated.reason


def test_a_reference_of_another_robot_is_refused(make_told: Callable[[np.ndarray], Study]) -> None:
    rng = np.random.default_rng(9)
    wrong = make_told(np.cumsum(rng.normal(0, 0.02, (10_000, 1)), axis=0))
    with pytest.raises(UndeterminedError, match=r"does not follow|runs away"):
        fit_study(wrong, Options(estimator="instruments"))


@pytest.fixture
def make_told() -> Callable[[np.ndarray], Study]:
    """A free joint with what its controller was told beside it."""

    def make(reference: np.ndarray) -> Study:
        study = ankle(0.02, free=True)
        log = study.trials[0].robot
        told = RobotLog(log.t, log.theta, log.tau, reference=reference)
        return Study("told", study.setup, (Trial("free_01", "free", "free", told),))

    return make
