"""A small study in memory for documentation and first steps: a planar robot, free and with a known spring."""

import numpy as np

from impid_host.robot.model import robot_model
from impid_host.study.model import RobotLog, RobotSetup, Session, Setup, Trial, TrialKind

ALPHA = (0.069, 0.042, 0.044, 0.065, 0.074)
MASS_KG = 0.8
K_N_PER_M = ((420.0, -20.0), (-20.0, 230.0))
_DURATION_S, _RATE_HZ = 20.0, 500.0
_NOISE_NM = 0.01


def example_parts() -> tuple[Setup, tuple[Trial, ...]]:
    """Apparatus and trials: two in free motion, one with a payload of 0.8 kg on springs."""
    robot = RobotSetup("planar-2r-absolute", (0.254, 0.2667))
    trials = (_trial(robot, "free_01", 1), _trial(robot, "free_02", 2), _trial(robot, "spring_01", 3))
    return Setup(robot, session=Session(subject="spring", side="right")), trials


def _trial(robot: RobotSetup, name: str, seed: int) -> Trial:
    """Ten sinusoids below 2 Hz in each joint; the torque is what robot and load need, and noise."""
    rng = np.random.default_rng(seed)
    kind: TrialKind = "free" if name.startswith("free") else "mass-spring"
    t = np.arange(0, _DURATION_S, 1 / _RATE_HZ)
    angular = 2 * np.pi * rng.uniform(0.1, 2.0, (10, 2))
    phase = rng.uniform(0, 2 * np.pi, (10, 2))
    size = 0.03 if kind == "free" else 0.012
    turn = angular * t[:, None, None] + phase
    theta = np.pi / 4 + size * np.sin(turn).sum(axis=1)
    omega = size * (angular * np.cos(turn)).sum(axis=1)
    acc = -size * (angular**2 * np.sin(turn)).sum(axis=1)
    model = robot_model(robot)
    tau = model.regressor(theta, omega, acc) @ np.array(ALPHA)
    if kind == "mass-spring":
        x, J = model.position(theta), model.jacobian(theta)
        v = np.einsum("kij,kj->ki", J, omega)
        given = MASS_KG * np.gradient(v, t, axis=0) + (x - x.mean(axis=0)) @ np.array(K_N_PER_M)
        tau = tau + np.einsum("kij,ki->kj", J, given)
    tau = tau + rng.normal(0, _NOISE_NM, tau.shape)
    return Trial(name, kind, name.partition("_")[0], RobotLog(t, theta, tau))
