"""A small study in closed form: [D]'s robot, free and with a mass on springs, no module."""

import datetime

import numpy as np
from impid_host.study.model import RobotLog, RobotSetup, Session, Setup, Study, Trial

L1, L2 = 0.254, 0.2667
ALPHA = np.array([0.06929, 0.04217, 0.04416, 0.06510, 0.07389])
K = np.array([[400.0, -30.0], [-30.0, 250.0]])
MASS = 0.5


def motion(t: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle, speed and acceleration of both joints, (2, N), as sums of sinusoids."""
    rng = np.random.default_rng(seed)
    angular = 2 * np.pi * rng.uniform(0.2, 2.0, (2, 6, 1))
    phase = rng.uniform(0, 2 * np.pi, (2, 6, 1))
    theta = 0.7 + 0.06 * np.sin(angular * t + phase).sum(axis=1)
    omega = 0.06 * (angular * np.cos(angular * t + phase)).sum(axis=1)
    return theta, omega, -0.06 * (angular**2 * np.sin(angular * t + phase)).sum(axis=1)


def trial(name: str, seed: int, *, stiffness: np.ndarray | None = None, sign: float = 1.0) -> Trial:
    """15 s by [D]'s equations 1 and 11 to 13; under load M x'' + K (x - x0) = -F_ext, F_ext on the robot."""
    t = np.arange(0, 15, 2e-3)
    (t1, t2), (w1, w2), (d1, d2) = motion(t, seed)
    a1, a2, a3, a4, a5 = ALPHA
    h, c = -0.5 * a2 * np.sin(t1 - t2), 0.5 * a2 * np.cos(t1 - t2)
    tau = np.stack([a1 * d1 + h * d2 + c * w2**2 + a4 * w1, h * d1 + a3 * d2 - c * w1**2 + a5 * w2], axis=1)
    if stiffness is not None:
        x = np.stack([L1 * np.cos(t1) + L2 * np.sin(t2), L1 * np.sin(t1) - L2 * np.cos(t2)], axis=1)
        acc = np.stack(
            [
                -L1 * (np.cos(t1) * w1**2 + np.sin(t1) * d1) + L2 * (np.cos(t2) * d2 - np.sin(t2) * w2**2),
                L1 * (np.cos(t1) * d1 - np.sin(t1) * w1**2) + L2 * (np.sin(t2) * d2 + np.cos(t2) * w2**2),
            ],
            axis=1,
        )
        force = MASS * acc + (x - x.mean(axis=0)) @ stiffness  # what the robot must give
        tau[:, 0] += -L1 * np.sin(t1) * force[:, 0] + L1 * np.cos(t1) * force[:, 1]
        tau[:, 1] += L2 * np.cos(t2) * force[:, 0] + L2 * np.sin(t2) * force[:, 1]
    rng = np.random.default_rng(seed + 100)
    tau = (tau + rng.normal(0, 0.01, tau.shape)) * np.array([sign, 1.0])
    log = RobotLog(t, np.stack([t1, t2], axis=1), tau)
    kind, load = ("free", "free") if stiffness is None else ("mass-spring", "spring")
    return Trial(name, kind, load, log)  # type: ignore[arg-type]


def study(
    name: str,
    *,
    sign: float = 1.0,
    stiffness: np.ndarray = K,
    day: int | None = None,
    subject: str = "P<07>",
    seed: int = 1,
) -> Study:
    """Two free trials and one under load."""
    trials = (
        trial("free_01", seed, sign=sign),
        trial("free_02", seed + 1, sign=sign),
        trial("spring_01", seed + 2, stiffness=stiffness, sign=sign),
    )
    date = None if day is None else datetime.date(2026, 11, day)
    session = Session(subject=subject, side="left", date=date)
    return Study(name, Setup(RobotSetup("planar-2r-absolute", (L1, L2)), session=session), trials)
