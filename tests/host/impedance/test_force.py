"""Virtual against physical force: errors that follow from the robot's own torque in closed form."""

import numpy as np
import pytest
from impid_host.impedance.campaign import Options, fit_study
from impid_host.impedance.force import STATICS, UNDER_LOAD
from impid_host.impedance.rows import Split
from impid_host.robot.planar_2r_relative import Planar2RRelative
from impid_host.study.model import RobotLog, RobotSetup, Setup, Study, Trial

L = (0.16, 0.16)
GRAVITY = (0.0, 9.81)
ROBOT = Planar2RRelative(*L, GRAVITY)
ALPHA = np.array([0.02, 0.006, 0.03, 0.002, 0.08, 0.004, 0.05, 0.03])


def leg(name: str, seed: int, *, loaded: bool, rate: float = 500.0) -> Trial:
    rng = np.random.default_rng(seed)
    t = np.arange(0, 30, 1 / rate)
    q, v, a = (np.zeros((len(t), 2)) for _ in range(3))
    for joint in range(2):
        for _ in range(6):
            w, phase = 2 * np.pi * rng.uniform(0.1, 1.5), rng.uniform(0, 2 * np.pi)
            q[:, joint] += 0.1 * np.sin(w * t + phase)
            v[:, joint] += 0.1 * w * np.cos(w * t + phase)
            a[:, joint] -= 0.1 * w**2 * np.sin(w * t + phase)
    q += [1.0, 0.9]
    force = np.stack([4 * np.sin(1.3 * t), 12 + 9 * np.sin(2.1 * t + 0.4)], axis=1) * loaded
    tau = ROBOT.regressor(q, v, a) @ ALPHA - np.einsum("kij,ki->kj", ROBOT.jacobian(q), force)
    return Trial(
        name,
        "mass-spring" if loaded else "free",
        name[:-3],
        RobotLog(t, q, tau, force=force if loaded else None),
    )


def study(*trials: Trial) -> Study:
    return Study("leg", Setup(RobotSetup("planar-2r-relative", L, GRAVITY)), trials)


def test_the_torque_alone_errs_by_the_robots_own_torque() -> None:
    trial = leg("press_01", 1, loaded=True)
    (compared,) = fit_study(study(trial), Options(split=Split(6.0))).forces
    alone, fitted = compared.errors
    assert (alone.by, fitted.by) == (STATICS, UNDER_LOAD)
    q = trial.robot.theta
    v, a = (
        np.gradient(q, trial.robot.t, axis=0),
        np.gradient(np.gradient(q, trial.robot.t, axis=0), trial.robot.t, axis=0),
    )
    own = ROBOT.regressor(q, v, a) @ ALPHA
    error = -np.linalg.solve(np.swapaxes(ROBOT.jacobian(q), 1, 2), own[:, :, None])[:, :, 0]
    judged = (trial.robot.t >= 24.0) & (trial.robot.t < 29.0)
    assert alone.rms == pytest.approx(np.sqrt(np.mean(error[judged] ** 2, axis=0)), rel=0.05)
    assert alone.bias == pytest.approx(error[judged].mean(axis=0), rel=0.05, abs=0.02)
    assert (fitted.rms < 0.02).all()
    assert alone.relative_percent == pytest.approx(100 * alone.rms / compared.signal_rms)


def test_a_robot_from_free_trials_stands_beside_the_torque_alone() -> None:
    result = fit_study(study(leg("free_01", 2, loaded=False), leg("press_01", 1, loaded=True)), Options())
    (compared,) = result.forces
    assert [error.by for error in compared.errors] == [STATICS, "robot from free trials"]
    assert (compared.errors[1].rms < 0.02).all()
    assert (compared.errors[0].rms > 1).any()
