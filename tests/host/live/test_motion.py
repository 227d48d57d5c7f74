"""Speeds of joints that are followed, against motions known exactly."""

import numpy as np
import pytest
from impid_host.live.motion import Motion, follow


def test_a_parabola_is_followed_without_a_lag() -> None:
    """Angles alone: the third state is the acceleration, at even and at uneven rows."""
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.5e-3, 2e-3, 600))
    theta = np.stack([0.2 + 0.5 * t + 1.5 * t**2, -2.0 * t**2], axis=1)
    omega, last = follow(None, t, theta, np.zeros_like(theta), 0.01)
    late = t > 0.3
    assert omega[late] == pytest.approx(np.stack([0.5 + 3.0 * t, -4.0 * t], axis=1)[late], abs=1e-5)
    assert last.lacking == pytest.approx([3.0, -4.0], abs=1e-3)


def test_in_pieces_it_is_the_same() -> None:
    t = np.arange(0, 1, 1e-3)
    theta, acc = np.sin(9 * t)[:, None], -81 * np.sin(9 * t)[:, None]
    whole, _ = follow(None, t, theta, acc, 0.05)
    state: Motion | None = None
    pieces = []
    for k in range(0, len(t), 13):
        omega, state = follow(state, t[k : k + 13], theta[k : k + 13], acc[k : k + 13], 0.05)
        pieces.append(omega)
    assert np.concatenate(pieces) == pytest.approx(whole, abs=1e-12)


def test_a_coarse_encoder_costs_nothing_beside_an_accelerometer_with_a_zero_that_has_moved() -> None:
    """4096 counts a turn: differences of the angles are wrong by 0.5 rad/s; speeds here by some 0.01."""
    t = np.arange(0, 6, 1e-3)
    true = 0.3 * np.sin(8 * t)
    theta = (np.round(true * 4096 / (2 * np.pi)) * 2 * np.pi / 4096)[:, None]
    speed = 2.4 * np.cos(8 * t)
    measured = (-19.2 * np.sin(8 * t) + 0.8)[:, None]
    omega, last = follow(None, t, theta, measured, 0.05)
    late = t > 1.0
    differences = np.diff(theta[:, 0], prepend=0) / 1e-3
    assert np.sqrt(np.mean((differences - speed)[late] ** 2)) > 0.5
    assert np.sqrt(np.mean((omega[:, 0] - speed)[late] ** 2)) < 0.02
    assert last.lacking[0] == pytest.approx(-0.8, abs=0.15)


def test_the_acceleration_goes_on_when_the_accelerometer_goes_and_comes() -> None:
    still = np.zeros(1)
    motion = Motion(1.0, still, still, np.array([5.0]), np.array([-0.5]))
    assert motion.by_angles().lacking == pytest.approx([4.5])
    assert motion.by_angles().measured == pytest.approx([0.0])
    assert motion.by_accelerometer(np.array([4.4])).lacking == pytest.approx([0.0])
