"""Energy and the structure of the equations of motion: what no choice of parameters may break."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hil_sim.plant.plant import Load, Plant

FROM = np.array([0.9, 0.2])
WITH = np.array([2.0, -3.0])


def inertia(q, alpha):
    """[D] eq. 11, shape (2, 2)."""
    h = -0.5 * alpha[1] * np.sin(q[0] - q[1])
    return np.array([[alpha[0], h], [h, alpha[2]]])


def coriolis(q, w, alpha, second_row):
    """[D] eq. 12 with the sign of the second row left open: -1 holds, +1 is the misprint."""
    c = 0.5 * alpha[1] * np.cos(q[0] - q[1])
    return np.array([[0.0, c * w[1]], [second_row * c * w[0], 0.0]])


def energy(q, w, alpha):
    return 0.5 * w @ inertia(q, alpha) @ w


def test_without_torque_and_friction_the_kinetic_energy_stays(frictionless, no_reference):
    plant = Plant(frictionless, FROM)
    plant.set_speed(WITH)
    before = plant.energy()
    assert before == pytest.approx(energy(FROM, WITH, frictionless.alpha), rel=1e-14)
    for _ in range(50):
        plant.run(no_reference(1.0))
        assert plant.energy() == pytest.approx(before, rel=1e-6)


def test_energy_goes_to_and_fro_between_mass_and_springs(frictionless, no_reference):
    load = Load(
        M=0.8 * np.eye(2),
        B=np.zeros((2, 2)),
        K=np.array([[400.0, -20.0], [-20.0, 200.0]]),
        x0=np.array([0.36, 0]),
    )
    plant = Plant(replace(frictionless, load=load), FROM)
    plant.set_speed(WITH)
    before = plant.energy()
    plant.run(no_reference(20.0))
    assert plant.energy() == pytest.approx(before, rel=1e-6)


def test_friction_takes_what_its_power_says(parameters, no_reference):
    """dE/dt = -(alpha4 w1^2 + alpha5 w2^2), summed by the trapezoidal rule at 8 kHz."""
    plant = Plant(parameters, FROM)
    plant.set_speed(WITH)
    before = plant.energy()
    motion = plant.run(no_reference(2.0))
    w = np.vstack([WITH, motion.w])
    power = w**2 @ np.array(parameters.alpha[3:])
    lost = np.trapezoid(power, dx=125e-6)
    assert before - plant.energy() == pytest.approx(lost, rel=1e-6)
    assert lost > 0.5 * before


@pytest.mark.parametrize(("second_row", "conserved"), [(-1.0, True), (1.0, False)])
def test_the_misprinted_sign_of_eq_12_would_be_seen(frictionless, second_row, conserved):
    """The same check on matrices written out here: it must pass with one sign and fail with the other."""
    alpha = np.array(frictionless.alpha)

    def rates(_t, state):
        q, w = state[:2], state[2:]
        return np.concatenate([w, np.linalg.solve(inertia(q, alpha), -coriolis(q, w, alpha, second_row) @ w)])

    end = solve_ivp(rates, (0.0, 5.0), np.concatenate([FROM, WITH]), method="DOP853", rtol=1e-11, atol=1e-12)
    drift = energy(end.y[:2, -1], end.y[2:, -1], alpha) / energy(FROM, WITH, alpha) - 1.0
    assert bool(abs(drift) < 1e-6) is conserved
    if not conserved:
        assert abs(drift) > 0.05


@pytest.mark.parametrize(("second_row", "skew"), [(-1.0, True), (1.0, False)])
def test_rate_of_inertia_minus_twice_coriolis_is_skew(frictionless, second_row, skew):
    rng = np.random.default_rng(3)
    alpha = np.array(frictionless.alpha)
    for _ in range(20):
        q, w = rng.uniform(-1.5, 1.5, 2), rng.uniform(-4.0, 4.0, 2)
        step = 1e-6
        rate = (inertia(q + step * w, alpha) - inertia(q - step * w, alpha)) / (2.0 * step)
        N = rate - 2.0 * coriolis(q, w, alpha, second_row)
        assert np.allclose(N, -N.T, atol=1e-8) is skew


def test_the_plant_moves_as_the_matrix_with_minus_says(frictionless, no_reference):
    """The plant's own acceleration, by differences of its speeds, against both signs."""
    plant = Plant(frictionless, FROM)
    plant.set_speed(WITH)
    motion = plant.run(no_reference(0.001))
    measured = (motion.w[0] - WITH) / 125e-6
    alpha = np.array(frictionless.alpha)
    middle = 0.5 * (FROM + motion.q[0])
    speed = 0.5 * (WITH + motion.w[0])

    def predicted(sign):
        return np.linalg.solve(inertia(middle, alpha), -coriolis(middle, speed, alpha, sign) @ speed)

    assert measured == pytest.approx(predicted(-1.0), rel=1e-5)
    assert abs(measured - predicted(1.0)).max() > 0.5
