"""A load whose trials show only part of it, through the command line, against the closed form."""

import json
from pathlib import Path

import numpy as np
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.study.folder import write_study
from impid_host.study.model import RobotLog, RobotSetup, Setup, Study, Trial

ROBOT = Planar2RAbsolute(0.254, 0.2667)
ALPHA = np.array([0.06929, 0.04217, 0.04416, 0.06510, 0.07389])
M = np.array([[1.45, 0.6], [0.7, 1.06]])
B = np.array([[10.9, 2.9], [2.6, 4.0]])
K = np.array([[72.3, 6.3], [16.1, 12.6]])
X0, Y_M = np.array([0.36, 0.05]), 0.04


def along_x() -> Study:
    """The hand moves along x at y = 0.04 m and nowhere else."""
    rng = np.random.default_rng(3)
    t = np.arange(0, 30, 1e-3)
    angular, phase = 2 * np.pi * rng.uniform(0.1, 2.0, (10, 1)), rng.uniform(0, 2 * np.pi, (10, 1))
    x = 0.37 + 0.006 * np.sin(angular * t + phase).sum(axis=0)
    v = 0.006 * (angular * np.cos(angular * t + phase)).sum(axis=0)
    a = -0.006 * (angular**2 * np.sin(angular * t + phase)).sum(axis=0)
    place = np.stack([x, np.full_like(x, Y_M)], axis=1)
    speed, acceleration = np.stack([v, 0 * v], axis=1), np.stack([a, 0 * a], axis=1)
    theta = np.full((len(t), 2), np.pi / 4)
    for _ in range(30):
        theta += np.linalg.solve(ROBOT.jacobian(theta), (place - ROBOT.position(theta))[:, :, None])[:, :, 0]
    J = ROBOT.jacobian(theta)
    omega = np.linalg.solve(J, speed[:, :, None])[:, :, 0]
    rest = acceleration - np.einsum("nij,nj->ni", ROBOT.jacobian_rate(theta, omega), omega)
    theta_dd = np.linalg.solve(J, rest[:, :, None])[:, :, 0]
    push = acceleration @ M.T + speed @ B.T + (place - X0) @ K.T
    tau = ROBOT.regressor(theta, omega, theta_dd) @ ALPHA + np.einsum("nji,nj->ni", J, push)
    log = RobotLog(
        t=t,
        theta=theta,
        tau=tau + rng.normal(0, 0.01, tau.shape),
        force=-push + rng.normal(0, 0.05, push.shape),
    )
    setup = Setup(robot=RobotSetup("planar-2r-absolute", (0.254, 0.2667)), prior_alpha=tuple(ALPHA))
    return Study("one_line", setup, (Trial("arm_01", "arm", "arm", log, None),))


def test_a_motion_along_one_line_shows_combinations_alone(tmp_path: Path) -> None:
    write_study(along_x(), tmp_path / "study")
    words = ["fit", str(tmp_path / "study"), "--json", str(tmp_path / "fit.json")]
    result = CliRunner().invoke(cli, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    load = json.loads((tmp_path / "fit.json").read_text())["loads"]["arm"]
    # y never changes: its column is the constant's, and nothing tells accelerations along y.
    c = K @ X0
    truth = {
        "mxx": M[0, 0],
        "myx": M[1, 0],
        "bxx": B[0, 0],
        "byx": B[1, 0],
        "kxx": K[0, 0],
        "kxy - 25*cx": K[0, 1] - 25 * c[0],
        "kyx": K[1, 0],
        "kyy - 25*cy": K[1, 1] - 25 * c[1],
    }
    for method in ("method1", "method2"):
        found = load[method]["combinations"]
        assert set(found) == set(truth)
        for name, entry in found.items():
            assert abs(entry["value"] - truth[name]) < 4 * entry["sd"] + 1e-3 * abs(truth[name])
            assert entry["sd"] < 0.05 * max(abs(truth[name]), 1.0)
    assert "kxy - 25*cx" in result.output
    assert "not all of it" in result.output


def test_too_short_a_trial_is_still_refused(tmp_path: Path) -> None:
    study = along_x()
    trial = study.trials[0]
    log = trial.robot
    assert log.force is not None
    short = RobotLog(t=log.t[:4500], theta=log.theta[:4500], tau=log.tau[:4500], force=log.force[:4500])
    write_study(
        Study("short", study.setup, (Trial("arm_01", "arm", "arm", short, None),)), tmp_path / "study"
    )
    result = CliRunner().invoke(cli, ["fit", str(tmp_path / "study")])
    assert result.exit_code != 0
    assert "longer trials are needed" in str(result.exception) + result.output


def test_figures_of_a_study_without_a_whole_load(tmp_path: Path) -> None:
    write_study(along_x(), tmp_path / "study")
    words = ["fit", str(tmp_path / "study"), "--constrain", "--figures", str(tmp_path / "figures")]
    result = CliRunner().invoke(cli, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output
