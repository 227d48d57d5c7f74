"""The momentum observer against closed forms; the mechanics are the tests' own."""

import numpy as np
import pytest
from impid_host.live.momentum import Momentum, observe
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.robot.slide_1d import Slide1D
from impid_host.robot.terms import RobotStructure, robot_structure

GAIN = 80.0


def pushed_mass(t: np.ndarray, mass: float, friction: float, drive: float, force: float):
    """A mass from rest under constant acceleration: position, speed and what the drive has to add."""
    acceleration = (drive + force) / mass
    speed = acceleration * t
    tau = drive + friction * speed
    return (0.5 * acceleration * t**2)[:, None], speed[:, None], tau[:, None]


@pytest.mark.parametrize("every", [1, 3])
def test_a_constant_force_comes_as_one_minus_an_exponential(every: int) -> None:
    """f (1 - exp(-gain t)) exactly, whether all rows come or every third, in one piece or in many."""
    t = np.arange(0, 0.2, 1e-3)[::every]
    theta, omega, tau = pushed_mass(t, 2.0, 0.7, 1.5, 5.0)
    structure, value = RobotStructure(Slide1D()), np.array([2.0, 0.7])
    whole, last = observe(structure, value, GAIN, None, t, theta, omega, tau)
    assert whole[:, 0] == pytest.approx(5.0 * (1 - np.exp(-GAIN * t)), abs=1e-9)
    assert last.load == pytest.approx(whole[-1])
    state: Momentum | None = None
    pieces = []
    for k in range(0, len(t), 7):
        part = slice(k, k + 7)
        load, state = observe(structure, value, GAIN, state, t[part], theta[part], omega[part], tau[part])
        pieces.append(load)
    assert np.concatenate(pieces) == pytest.approx(whole, abs=1e-12)


def test_rows_that_are_missing_leave_the_force_where_it_belongs() -> None:
    t = np.delete(np.arange(0, 0.3, 1e-3), np.s_[100:160])
    theta, omega, tau = pushed_mass(t, 1.2, 0.0, 0.0, -3.0)
    load, _ = observe(RobotStructure(Slide1D()), np.array([1.2, 0.0]), GAIN, None, t, theta, omega, tau)
    assert load[:, 0] == pytest.approx(-3.0 * (1 - np.exp(-GAIN * t)), abs=1e-9)


def test_a_rotor_beside_the_links_is_part_of_the_momentum() -> None:
    t = np.arange(0, 0.2, 1e-3)
    theta, omega, tau = pushed_mass(t, 2.0 + 0.5, 0.0, 1.0, 4.0)
    structure = robot_structure(Slide1D(), ("inertia.rotor",))
    load, _ = observe(structure, np.array([2.0, 0.0, 0.5]), GAIN, None, t, theta, omega, tau)
    assert load[:, 0] == pytest.approx(4.0 * (1 - np.exp(-GAIN * t)), abs=1e-9)


ALPHA = np.array([0.069, 0.042, 0.044, 0.065, 0.074])


def energy(theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Kinetic energy of two bars, the second coupled to the first by the angle between them, (N,)."""
    coupling = -0.5 * ALPHA[1] * np.sin(theta[:, 0] - theta[:, 1])
    own = 0.5 * ALPHA[0] * omega[:, 0] ** 2 + 0.5 * ALPHA[2] * omega[:, 1] ** 2
    return own + coupling * omega[:, 0] * omega[:, 1]


def lagrange(t: np.ndarray, theta, omega, step: float = 1e-6) -> np.ndarray:
    """d/dt dT/domega - dT/dtheta by differences of the energy alone, (N, 2)."""
    both = []
    for joint in np.eye(2) * step:

        def momentum(at: np.ndarray, joint: np.ndarray = joint) -> np.ndarray:
            return (energy(theta(at), omega(at) + joint) - energy(theta(at), omega(at) - joint)) / (2 * step)

        h = 1e-4
        change = (momentum(t + h) - momentum(t - h)) / (2 * h)
        pull = (energy(theta(t) + joint, omega(t)) - energy(theta(t) - joint, omega(t))) / (2 * step)
        both.append(change - pull)
    return np.stack(both, axis=1)


def test_an_arm_in_quick_motion_shows_the_load_low_passed() -> None:
    """A load of 3 Hz on an arm whose Coriolis torques are large: gain and phase of a first-order low-pass."""
    t = np.arange(0, 4.0, 1e-3)

    def theta(at: np.ndarray) -> np.ndarray:
        return np.stack([0.8 * np.sin(7.0 * at), 0.3 + 0.9 * np.sin(9.0 * at + 1.0)], axis=1)

    def omega(at: np.ndarray) -> np.ndarray:
        return np.stack([5.6 * np.cos(7.0 * at), 8.1 * np.cos(9.0 * at + 1.0)], axis=1)

    angular = 2 * np.pi * 3.0
    size = np.array([0.5, -0.3])
    load = size * np.sin(angular * t)[:, None]
    inertial = lagrange(t, theta, omega)
    tau = inertial + ALPHA[3:] * omega(t) - load
    found, _ = observe(
        RobotStructure(Planar2RAbsolute(0.25, 0.27)), ALPHA, GAIN, None, t, theta(t), omega(t), tau
    )
    response = 1 / (1 + 1j * angular / GAIN)
    expected = size * (np.abs(response) * np.sin(angular * t + np.angle(response)))[:, None]
    settled = t > 0.2
    assert np.abs(found - expected)[settled].max() < 2e-3
    # Without the Coriolis torques it would be off by more than the load is large.
    assert np.abs(inertial).max() > 2 * np.abs(load).max()
