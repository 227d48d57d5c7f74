"""A chain of revolute joints, free, its torques by Pinocchio: how a fit grows with the joints."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import impid_host
import numpy as np
import pinocchio
from impid_host.front import of_model
from impid_host.study.model import RobotLog, RobotSetup, Setup, Study, Trial

RATE_HZ, SECONDS, NOISE_NM = 500.0, 40.0, 0.05


def chain(joints: int) -> str:
    """URDF of links of 0.2 m, each turning about another axis than the one before it."""
    text = ['<robot name="chain"><link name="link0"/>']
    for number in range(1, joints + 1):
        axis = "0 0 1" if number % 2 else "0 1 0"
        body = '<inertial><origin xyz="0.1 0.01 0.02"/><mass value="1.5"/><inertia ixx="0.004" iyy="0.006" izz="0.006" ixy="0" ixz="0" iyz="0"/></inertial>'
        text.append(f'<link name="link{number}">{body}</link>')
        text.append(
            f'<joint name="joint{number}" type="revolute"><parent link="link{number - 1}"/><child link="link{number}"/>'
            f'<origin xyz="0.2 0 0"/><axis xyz="{axis}"/><limit lower="-9" upper="9" effort="1e9" velocity="1e9"/></joint>'
        )
    return "".join(text) + "</robot>"


def fit(joints: int) -> Iterator[int]:
    """`fit` of two free trials of 40 s."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "chain.urdf"
        path.write_text(chain(joints))
        model = pinocchio.buildModelFromXML(chain(joints))
        trials = tuple(_trial(model, joints, seed) for seed in (1, 2))
        whole = of_model(Study("chain", Setup(RobotSetup("urdf", urdf=path)), trials))
        yield sum(len(trial.robot) for trial in trials)
        impid_host.fit(whole)


def _trial(model: pinocchio.Model, joints: int, seed: int) -> Trial:
    rng, data = np.random.default_rng(seed), model.createData()
    t = np.arange(0, SECONDS, 1 / RATE_HZ)
    w = 2 * np.pi * rng.uniform(0.1, 1.5, (8, joints))
    turn = w * t[:, None, None] + rng.uniform(0, 2 * np.pi, (8, joints))
    theta, omega = 0.15 * np.sin(turn).sum(axis=1), 0.15 * (w * np.cos(turn)).sum(axis=1)
    acc = -0.15 * (w**2 * np.sin(turn)).sum(axis=1)
    tau = np.array([pinocchio.rnea(model, data, *row) for row in zip(theta, omega, acc, strict=True)])
    tau = tau + 0.5 * omega + rng.normal(0, NOISE_NM, tau.shape)
    return Trial(f"free_{seed:02d}", "free", "free", RobotLog(t, theta, tau))
