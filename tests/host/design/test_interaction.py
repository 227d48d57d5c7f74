from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
from impid_host.design.interaction import Contact, modified_perturbation
from impid_host.design.perturbation import design_perturbation

CONTACT = Contact(
    inertia=np.array([[0.069, -0.005], [-0.005, 0.044]]),
    friction=np.diag([0.065, 0.074]),
    jacobian=np.array([[-0.18, 0.19], [0.18, 0.19]]),
    kp=60.0,
    kd=4.0,
    M=np.array([[1.4, 0.6], [0.6, 1.0]]),
    B=np.array([[10.0, 3.0], [3.0, 5.0]]),
    K=np.array([[150.0, 30.0], [30.0, 100.0]]),
)
FREQUENCY = np.array([0.1, 1.0, 3.0, 8.0, 15.0])


def _impedances_in_series(c, frequency):
    """The same contact without states: F passes robot, transducer and load, whose mobilities add up."""
    out = []
    for s in 2j * np.pi * frequency:
        J_inverse = np.linalg.inv(c.jacobian)
        robot = J_inverse.T @ (s**2 * c.inertia + s * c.friction) @ J_inverse + (c.kp + s * c.kd) * np.eye(2)
        load = s**2 * c.M + s * c.B + c.K
        transducer = (c.k_t + s * c.b_t) * np.eye(2)
        compliance = np.linalg.inv(robot) + np.linalg.inv(load) + np.linalg.inv(transducer)
        out.append(np.linalg.solve(compliance, np.linalg.inv(robot)))
    return np.array(out)


@pytest.mark.parametrize("contact", [CONTACT, replace(CONTACT, k_t=500.0, b_t=3.0)])
def test_eight_states_give_the_impedances_in_series(contact):
    A, B, C, D = contact.state_space()
    assert A.shape == (8, 8)
    assert B.shape == (8, 2)
    assert C.shape == (2, 8)
    assert not D.any()
    np.testing.assert_allclose(
        contact.response(FREQUENCY), _impedances_in_series(contact, FREQUENCY), rtol=1e-8
    )


def test_the_contact_is_stable_and_divides_a_steady_force_between_spring_and_hold():
    A, *_ = CONTACT.state_space()
    assert np.all(np.linalg.eigvals(A).real < 0)
    static = CONTACT.K @ np.linalg.inv(CONTACT.K + CONTACT.kp * np.eye(2))
    np.testing.assert_allclose(CONTACT.response(np.array([1e-6]))[0].real, static, rtol=1e-3)


def test_modified_commands_deliver_the_intended_forces():
    """The eight equations of motion integrated in time, commanded with F_new, return F_old at the arm."""
    F_old = design_perturbation(3.0, duration_s=20.0, candidates=4).force[:5000]
    F_new = modified_perturbation(F_old, 500.0, CONTACT, max_gain=np.inf, upper_Hz=40.0)
    soft = replace(CONTACT, k_t=2.0e4, b_t=100.0)
    t = np.arange(5000) / 500.0
    A, B, C, _ = soft.state_space()
    solution = scipy.integrate.solve_ivp(
        lambda s, q: A @ q + B @ np.array([np.interp(s, t, F_new[:, 0]), np.interp(s, t, F_new[:, 1])]),
        (0, t[-1]),
        np.zeros(8),
        t_eval=t,
        method="LSODA",
        max_step=0.002,
        rtol=1e-6,
        atol=1e-9,
    )
    delivered = (C @ solution.y).T
    plain_error = np.sqrt(
        np.mean((CONTACT.response(np.array([2.0]))[0].real @ F_old[500:].T - F_old[500:].T) ** 2)
    )
    error = np.sqrt(np.mean((delivered - F_old)[500:] ** 2))
    assert error < 0.1 * 3.0
    assert error < 0.2 * plain_error


def test_the_gain_is_limited_at_the_load_s_resonance():
    springs = replace(CONTACT, M=0.429 * np.eye(2), B=0.2 * np.eye(2), K=300.0 * np.eye(2))
    F_old = design_perturbation(3.0, candidates=4).force
    free = modified_perturbation(F_old, 500.0, springs, max_gain=np.inf)
    limited = modified_perturbation(F_old, 500.0, springs, max_gain=5.0)
    assert np.sqrt(np.mean(limited**2)) < 5.0 * np.sqrt(np.mean(F_old**2))
    assert np.max(np.abs(free)) > 2 * np.max(np.abs(limited))


def test_an_arm_without_stiffness_gets_finite_commands():
    free = replace(CONTACT, K=np.zeros((2, 2)))
    assert np.all(
        np.isfinite(modified_perturbation(design_perturbation(1.0, candidates=4).force, 500.0, free))
    )
