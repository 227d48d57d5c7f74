"""The second simulator's mechanics against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from independent.laboratory import draw
from independent.mechanics import Load, Robot
from scipy.integrate import solve_ivp

RNG = np.random.default_rng(5)
FREE = Robot((0.3, 0.25), (0.12, 0.05, 0.06, 0.0, 0.0), (0.25, 0.1))


def states(n=40):
    return RNG.uniform(0.2, 1.4, (n, 2)), RNG.normal(0, 2, (n, 2)), RNG.normal(0, 9, (n, 2))


def test_point_masses_give_the_inertia():
    """Two point masses at the links' ends: T = ½ m1 |v1|² + ½ m2 |v2|², from their velocities."""
    l1, l2, m1, m2 = 0.3, 0.25, 0.7, 0.4
    robot = Robot((l1, l2), ((m1 + m2) * l1**2, 2 * m2 * l1 * l2, m2 * l2**2, 0, 0), (0, 0))
    theta, omega, _ = states()
    elbow = l1 * omega[:, 0]
    tip, _ = robot.tip_rates(theta, omega, np.zeros_like(omega))
    kinetic = 0.5 * m1 * elbow**2 + 0.5 * m2 * (tip**2).sum(1)
    assert robot.energy(theta, omega) == pytest.approx(kinetic, rel=1e-12)


def test_energy_stays_without_friction_and_force():
    def slope(_, y):
        theta, omega = y[None, :2], y[None, 2:]
        bias = FREE.inverse(theta, omega, np.zeros((1, 2)))[0]
        inertia = np.column_stack([FREE.inertia_times(theta, e[None])[0] for e in np.eye(2)])
        return np.concatenate([omega[0], np.linalg.solve(inertia, -bias)])

    path = solve_ivp(slope, (0, 3), [0.5, 0.8, 1.5, -2.0], rtol=1e-10, atol=1e-12).y.T
    energy = FREE.energy(path[:, :2], path[:, 2:])
    assert np.ptp(path[:, 0]) > 1
    assert energy == pytest.approx(energy[0], rel=1e-7)


def test_power_of_the_torque_is_the_energy_gained():
    theta, omega, accel = states()
    step = 1e-6
    later = FREE.energy(theta + omega * step + accel * step**2 / 2, omega + accel * step)
    gained = (later - FREE.energy(theta - omega * step + accel * step**2 / 2, omega - accel * step)) / (
        2 * step
    )
    assert (FREE.inverse(theta, omega, accel) * omega).sum(1) == pytest.approx(gained, rel=1e-5, abs=1e-6)


def test_tip_rates_are_derivatives_of_the_tip():
    theta, omega, accel = states()
    h = 1e-4

    def at(t):
        return FREE.tip(theta + omega * t + accel * t**2 / 2)

    velocity, acceleration = FREE.tip_rates(theta, omega, accel)
    assert velocity == pytest.approx((at(h) - at(-h)) / (2 * h), abs=1e-5)
    assert acceleration == pytest.approx((at(h) - 2 * at(0) + at(-h)) / h**2, abs=1e-4)


def test_statics_by_virtual_work():
    theta, omega, _ = states()
    force = RNG.normal(0, 5, theta.shape)
    velocity, _ = FREE.tip_rates(theta, omega, np.zeros_like(omega))
    torque = FREE.to_joints(theta, force)
    assert (torque * omega).sum(1) == pytest.approx((force * velocity).sum(1), rel=1e-10)
    assert FREE.to_tip(theta, torque) == pytest.approx(force, rel=1e-9)
    assert FREE.solve(theta, velocity) == pytest.approx(omega, rel=1e-9)


def test_acceleration_of_the_joints_comes_back():
    theta, omega, accel = states()
    _, tip = FREE.tip_rates(theta, omega, accel)
    assert FREE.joint_accel(theta, omega, tip) == pytest.approx(accel, rel=1e-8)


def test_hold_is_the_slope_of_the_weight():
    theta, _, _ = states()
    g, h = np.array([0.3, -9.6]), 1e-6
    mu1, mu2 = FREE.moments

    def weight(q):
        first = mu1 * (np.cos(q[:, 0]) * g[0] + np.sin(q[:, 0]) * g[1])
        return -(first + mu2 * (np.sin(q[:, 1]) * g[0] - np.cos(q[:, 1]) * g[1]))

    for joint in range(2):
        e = h * np.eye(2)[joint]
        slope = (weight(theta + e) - weight(theta - e)) / (2 * h)
        assert FREE.hold(theta, g)[:, joint] == pytest.approx(slope, abs=1e-7)


def test_spring_pulls_back_by_its_stiffness():
    K = np.array([[300.0, 20.0], [20.0, 200.0]])
    load = Load("s", "mass-spring", np.eye(2), np.zeros((2, 2)), K, np.array([0.3, 0.1]))
    force = load.force(np.array([[0.31, 0.1], [0.3, 0.08]]), np.zeros((2, 2)), np.zeros((2, 2)))
    assert force == pytest.approx(np.array([[-3.0, -0.2], [0.4, 4.0]]))


@pytest.mark.parametrize("seed", range(20))
def test_drawn_laboratories_are_possible(seed):
    lab = draw(seed)
    a1, a2, a3 = lab.robot.alpha[:3]
    assert a1 * a3 > (a2 / 2) ** 2
    assert a2 / 2 == pytest.approx(lab.robot.lengths[0] * lab.robot.moments[1])
    for load in {p.load.name: p.load for p in lab.plans if p.load}.values():
        assert np.linalg.eigvalsh(load.M).min() > 0
        assert np.linalg.eigvalsh(load.B).min() >= 0
        assert np.linalg.eigvalsh(load.K + load.K.T).min() > 0
