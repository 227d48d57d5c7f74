"""Parameters that only the accelerometer's noise shows are not reported as numbers."""

import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.identify import identify_load, identify_robot
from impid_host.impedance.loads import arm
from impid_host.impedance.partial import identify_partially
from impid_host.impedance.rows import Split
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.robot.terms import RobotStructure
from impid_host.signals.align import AlignedTrial, joint_acceleration
from impid_host.signals.chain import DEFAULT, erode

ROBOT = Planar2RAbsolute(0.254, 0.2667)
STRUCTURE = RobotStructure(ROBOT)
ALPHA = np.array([0.06929, 0.04217, 0.04416, 0.06510, 0.07389])
RATE = 250.0
M, B, K = 1.2 * np.eye(2), np.diag([10.0, 6.0]), np.array([[90.0, 10.0], [10.0, 60.0]])


def motion(rng: np.random.Generator, size: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time, and ten sinusoids with their two derivatives."""
    t = np.arange(int(30 * RATE)) / RATE
    w, p = 2 * np.pi * rng.uniform(0.1, 2.0, (10, 1)), rng.uniform(0, 2 * np.pi, (10, 1))
    x = size * np.sin(w * t + p).sum(axis=0)
    return t, x, size * (w * np.cos(w * t + p)).sum(axis=0), -size * (w**2 * np.sin(w * t + p)).sum(axis=0)


def trial(
    rng: np.random.Generator,
    t: np.ndarray,
    theta: np.ndarray,
    omega: np.ndarray,
    theta_dd: np.ndarray,
    kind: str = "free",
) -> AlignedTrial:
    """As measured: angles by fine encoders, accelerations by an accelerometer with noise."""
    J, J_rate = ROBOT.jacobian(theta), ROBOT.jacobian_rate(theta, omega)
    x, v = ROBOT.position(theta), np.einsum("nij,nj->ni", J, omega)
    a = np.einsum("nij,nj->ni", J, theta_dd) + np.einsum("nij,nj->ni", J_rate, omega)
    tau = ROBOT.regressor(theta, omega, theta_dd) @ ALPHA + rng.normal(0, 0.02, theta.shape)
    force = -(a @ M.T + v @ B.T + (x - [0.37, 0.0]) @ K.T)
    a = a + rng.normal(0, 0.015, a.shape)
    return AlignedTrial(
        name="trial",
        kind=kind,  # type: ignore[arg-type]
        load=kind,
        t=t,
        rate_hz=RATE,
        theta=theta,
        omega=omega,
        theta_dd=joint_acceleration(a, J, J_rate, omega),
        tau=tau,
        force=force + rng.normal(0, 0.1, force.shape),
        perturbation=None,
        x=x,
        v=v,
        a=a,
        valid=erode(np.ones(len(t), dtype=bool), 250),
        source="accelerometer",
        clock=None,
    )


def pair(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.stack([first, second], axis=1)


def test_a_joint_that_stands_still_shows_no_inertia() -> None:
    rng = np.random.default_rng(1)
    t, x, v, a = motion(rng, 0.07)
    still = np.zeros_like(x)
    fit = identify_robot(
        [trial(rng, t, pair(0.8 + x, 0.6 + still), pair(v, still), pair(a, still))],
        STRUCTURE,
        DEFAULT,
        Split(),
    )
    assert fit.estimate.names == ("alpha1", "alpha2", "alpha4")
    assert fit.estimate.value == pytest.approx(ALPHA[[0, 1, 3]], rel=0.02)


def test_an_ordinary_motion_hides_nothing() -> None:
    rng = np.random.default_rng(3)
    t, *first = motion(rng, 0.07)
    _, *second = motion(rng, 0.002)  # a joint that hardly moves, yet above the noise
    shifted = pair(0.8 + first[0], 0.6 + second[0])
    fit = identify_robot(
        [trial(rng, t, shifted, pair(first[1], second[1]), pair(first[2], second[2]))],
        STRUCTURE,
        DEFAULT,
        Split(),
    )
    assert fit.estimate.names == STRUCTURE.parameter_names


def test_a_hand_that_moves_along_a_line_shows_no_inertia_across_it() -> None:
    rng = np.random.default_rng(4)
    t, x, v, a = motion(rng, 0.005)
    theta = np.full((len(t), 2), np.pi / 4)
    goal = np.stack([0.37 + x, np.full_like(x, 0.04)], axis=1)
    for _ in range(30):
        theta += np.linalg.solve(ROBOT.jacobian(theta), (goal - ROBOT.position(theta))[:, :, None])[:, :, 0]
    still = np.zeros_like(x)
    J = ROBOT.jacobian(theta)
    omega = np.linalg.solve(J, pair(v, still)[:, :, None])[:, :, 0]
    rest = pair(a, still) - np.einsum("nij,nj->ni", ROBOT.jacobian_rate(theta, omega), omega)
    trials = [trial(rng, t, theta, omega, np.linalg.solve(J, rest[:, :, None])[:, :, 0], "arm")]
    with pytest.raises(UndeterminedError, match="arm") as error:
        identify_load(trials, arm(), DEFAULT, Split(), robot=None, handle_mass_kg=0.0)
    part = identify_partially(trials, arm(), DEFAULT, Split(), robot=None, error=error.value)
    found = dict(zip(part.estimate.names, part.estimate.value, strict=True))
    assert not {"mxy", "myy", "bxy", "byy"} & set(found)
    assert found["mxx"] == pytest.approx(1.2, rel=0.01)
    assert found["kxx"] == pytest.approx(90.0, rel=0.01)
    assert found["kyx"] == pytest.approx(10.0, abs=0.2)
