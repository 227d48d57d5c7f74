"""Logs that cannot be believed, and logs that are merely coarse."""

import numpy as np
import pytest
from impid_host.diagnosis.oddities import odd_rows
from impid_host.study.model import RobotLog

T = np.arange(0.0, 20.0, 1e-3)
SMOOTH = 0.8 * np.sin(2 * np.pi * 0.6 * T) + 0.3 * np.sin(2 * np.pi * 1.7 * T)


def log(tau: np.ndarray, theta: np.ndarray | None = None) -> RobotLog:
    angle = np.sin(2 * np.pi * 0.6 * T) if theta is None else theta
    return RobotLog(t=T, theta=np.stack([angle, angle], axis=1), tau=np.stack([tau, SMOOTH], axis=1))


def noisy(tau: np.ndarray) -> np.ndarray:
    return tau + 1e-3 * np.random.default_rng(1).standard_normal(len(tau))


def test_an_ordinary_log_is_believed() -> None:
    bad, found = odd_rows("free_01", log(noisy(SMOOTH)))
    assert not bad.any()
    assert not found


def test_torque_in_steps_of_20_mNm_stands_still_nowhere() -> None:
    bad, found = odd_rows("free_01", log(np.round(SMOOTH / 0.02) * 0.02))
    assert not bad.any()
    assert all(own.share == 0.0 for own in found)
    (own,) = found
    assert "steps of 0.02" in own.words


def test_torque_at_its_limit_is_cut_off_there() -> None:
    tau = np.clip(noisy(SMOOTH), -0.7, 0.7)
    bad, found = odd_rows("free_01", log(tau))
    held = np.abs(noisy(SMOOTH)) > 0.7
    (own,) = found
    assert "cut off at its limit" in own.words and own.on == "tau1"
    assert own.share == pytest.approx(held.mean(), rel=0.1)
    assert np.mean(bad == held) > 0.98


def test_a_log_that_freezes_while_the_joint_moves_is_left_out() -> None:
    tau = noisy(SMOOTH)
    tau[5000:6000] = tau[5000]
    bad, found = odd_rows("free_01", log(tau))
    (own,) = found
    assert "stands still while the joint moves" in own.words
    assert np.flatnonzero(bad) == pytest.approx(np.arange(5000, 6000), abs=1)


def test_a_joint_at_rest_may_have_a_steady_torque() -> None:
    tau, theta = noisy(SMOOTH), np.sin(2 * np.pi * 0.6 * T)
    tau[5000:6000], theta[4900:6100] = tau[5000], theta[4900]
    bad, found = odd_rows("free_01", log(tau, theta))
    assert not bad.any() and not found
