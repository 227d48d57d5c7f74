"""The motion itself against an independent integration and a closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hil_sim.plant.kinematics import joint_angles, position
from hil_sim.plant.plant import Load, Plant

LOAD = Load(
    M=np.diag([1.1, 1.1]),
    B=np.array([[3.0, 0.5], [0.5, 2.0]]),
    K=np.array([[373.81, 73.16], [73.16, 377.10]]),
    x0=np.array([0.332, -0.061]),
)


def place(q, lengths):
    """x = l1 cos q1 + l2 sin q2, y = l1 sin q1 - l2 cos q2, written out again."""
    return np.array(
        [
            lengths[0] * np.cos(q[0]) + lengths[1] * np.sin(q[1]),
            lengths[0] * np.sin(q[0]) - lengths[1] * np.cos(q[1]),
        ]
    )


def jacobian(q, lengths):
    """dx/dq of `place`."""
    return np.array(
        [
            [-lengths[0] * np.sin(q[0]), lengths[1] * np.cos(q[1])],
            [lengths[0] * np.cos(q[0]), lengths[1] * np.sin(q[1])],
        ]
    )


def lagrange(parameters):
    """Lagrange's equations from the energies alone: d/dt (dT/dw) - dT/dq + dV/dq = -damping.

    The generalised momentum p = A(q) w is the state beside q, and the gradients are taken by complex steps
    (exact to rounding), so neither the Coriolis matrix nor J' is written down anywhere.
    """
    alpha, lengths, load = parameters.alpha, parameters.link_lengths_m, parameters.load

    def inertia(q):
        h = -0.5 * alpha[1] * np.sin(q[0] - q[1])
        J = jacobian(q, lengths)
        return np.array([[alpha[0], h], [h, alpha[2]]]) + J.T @ load.M @ J

    def minus_lagrangian(q, w):
        d = place(q, lengths) - load.x0
        return 0.5 * d @ load.K @ d - 0.5 * w @ inertia(q) @ w

    def rates(_t, state):
        q, p = state[:2], state[2:]
        w = np.linalg.solve(inertia(q), p)
        gradient = [minus_lagrangian(q + 1e-30j * e, w).imag / 1e-30 for e in np.eye(2)]
        J = jacobian(q, lengths)
        damping = np.array(alpha[3:]) * w + J.T @ load.B @ J @ w
        return np.concatenate([w, -np.array(gradient) - damping])

    return rates, inertia


@pytest.mark.parametrize("load", [Load.none(), LOAD], ids=["free", "mass-spring-damper"])
def test_motion_agrees_with_lagranges_equations(parameters, no_reference, load):
    parameters = replace(parameters, load=load)
    q0, w0 = np.array([0.6, 0.9]), np.array([1.5, -1.0])
    rates, inertia = lagrange(parameters)
    start = np.concatenate([q0, inertia(q0) @ w0])
    truth = solve_ivp(rates, (0.0, 1.5), start, method="DOP853", rtol=1e-10, atol=1e-11)
    plant = Plant(parameters, q0)
    plant.set_speed(w0)
    motion = plant.run(no_reference(1.5))
    assert motion.q[-1] == pytest.approx(truth.y[:2, -1], abs=1e-7)


@pytest.mark.parametrize("frequency_Hz", [0.5, 2.0, 4.0, 8.0])
def test_small_motion_follows_the_linear_frequency_response(parameters, frequency_Hz):
    """End-effector over torque about the springs' equilibrium: J (K_J - w^2 A + i w D)^-1, within 0.1 %."""
    q0 = joint_angles(LOAD.x0, parameters.link_lengths_m)
    parameters = replace(
        parameters, load=LOAD, kp=(60.0, 60.0), kd=(2.0, 2.0), counts_per_rev=(6_000_000_000, 6_000_000_000)
    )
    plant = Plant(parameters, q0)
    t = np.arange(12_000) * 1e-3
    omega = 2.0 * np.pi * frequency_Hz
    amplitude = 3e-4 * np.array([1.0, -0.6])
    reference = np.hstack([q0 + amplitude * np.sin(omega * t)[:, None], np.zeros((t.size, 2))])
    motion = plant.run(reference)

    # Fourier coefficients over the last 4 s, a whole number of periods. The torque is a staircase of 1 ms.
    held = motion.torque[8000:]
    staircase = (1.0 - np.exp(-1j * omega * 1e-3)) / (1j * omega * 1e-3)
    torque = staircase * (np.exp(-1j * omega * t[8000:]) @ held) / held.shape[0]
    fine_t = 8.0 + np.arange(1, 32_001) * 125e-6
    x = position(motion.q[64_000:], parameters.link_lengths_m) - LOAD.x0
    measured = np.exp(-1j * omega * fine_t) @ x / fine_t.size

    alpha, lengths = parameters.alpha, parameters.link_lengths_m
    J = jacobian(q0, lengths)
    h = -0.5 * alpha[1] * np.sin(q0[0] - q0[1])
    A = np.array([[alpha[0], h], [h, alpha[2]]]) + J.T @ LOAD.M @ J
    D = np.diag(alpha[3:]) + J.T @ LOAD.B @ J
    expected = J @ np.linalg.solve(J.T @ LOAD.K @ J - omega**2 * A + 1j * omega * D, torque)
    assert np.abs(measured - expected).max() < 1e-3 * np.abs(expected).max()


def test_means_over_a_step_are_differences_of_speed(parameters):
    """Mean acceleration times the step is the change of the tip's velocity, torque steps or not."""
    parameters = replace(parameters, load=LOAD, kp=(150.0, 150.0), kd=(5.0, 5.0))
    q0 = joint_angles(LOAD.x0, parameters.link_lengths_m)
    plant = Plant(parameters, q0)
    t = np.arange(500) * 1e-3
    reference = np.hstack([q0 + 0.05 * np.sin(12 * t)[:, None] * np.ones(2), np.zeros((500, 2))])
    motion = plant.run(reference)
    velocity = np.array(
        [jacobian(q, parameters.link_lengths_m) @ w for q, w in zip(motion.q, motion.w, strict=True)]
    )
    change = np.diff(velocity, axis=0) / 125e-6
    assert motion.acceleration[1:] == pytest.approx(change, abs=2e-5)
    # And the force is what the load does at that mean motion.
    x = position(motion.q, parameters.link_lengths_m)
    middle = 0.5 * (x[1:] + x[:-1]) - LOAD.x0
    speed = 0.5 * (velocity[1:] + velocity[:-1])
    force = -(motion.acceleration[1:] @ LOAD.M.T + speed @ LOAD.B.T + middle @ LOAD.K.T)
    assert motion.force[1:] == pytest.approx(force, abs=1e-4)


@pytest.mark.parametrize("x", [(0.364, -0.009), (0.394, 0.053), (0.332, -0.061), (0.2, 0.3)])
def test_joint_angles_put_the_end_effector_there(x):
    q = joint_angles(np.array(x), (0.254, 0.2667))
    assert place(q, (0.254, 0.2667)) == pytest.approx(x, abs=1e-12)
    assert np.cos(q[0] - q[1]) > 0.0


def test_a_place_out_of_reach_is_refused():
    with pytest.raises(ValueError, match="out of reach"):
        joint_angles(np.array([0.6, 0.0]), (0.254, 0.2667))
