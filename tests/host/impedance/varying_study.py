"""Studies of one joint in closed form whose stiffness follows a known course, with a column beside."""

import numpy as np
from impid_host.study.model import RobotLog, RobotSetup, Setup, Study, Trial

RATE = 200.0


def course(t: np.ndarray) -> np.ndarray:
    """K(t), N m/rad: rises softly from 50 to 80 in the middle of the trial."""
    return 65.0 + 15.0 * np.tanh((t - 0.5 * t[-1]) / 4.0)


def one(
    name: str, seed: int, stiffness: np.ndarray, t: np.ndarray, activity: np.ndarray, noise: float = 0.02
) -> Trial:
    """tau = 0.05 theta'' + 1.2 theta' + K (theta - 0.1) along sinusoids up to 4 Hz, and a column `emg`."""
    rng = np.random.default_rng(seed)
    w, p = 2 * np.pi * rng.uniform(0.2, 4.0, 16), rng.uniform(0, 2 * np.pi, 16)
    angle = np.multiply.outer(t, w) + p
    q = 0.012 * np.sin(angle).sum(axis=1)
    v = 0.012 * (w * np.cos(angle)).sum(axis=1)
    a = -0.012 * (w**2 * np.sin(angle)).sum(axis=1)
    tau = 0.05 * a + 1.2 * v + stiffness * (q - 0.1) + rng.normal(0, noise, len(t))
    log = RobotLog(t, q[:, None], tau[:, None], columns={"emg": activity})
    return Trial(name, "arm", "joint", log)


def rising(seconds: float = 40.0) -> Study:
    """A joint that stiffens by 60 %."""
    t = np.arange(0, seconds, 1 / RATE)
    trial = one("joint_01", 3, course(t), t, np.zeros(len(t)))
    return Study("rising", Setup(RobotSetup("joint-1d")), (trial,))


def still(seed: int, seconds: float = 40.0) -> Study:
    """A joint that does not change."""
    t = np.arange(0, seconds, 1 / RATE)
    trial = one("joint_01", seed, np.full(len(t), 65.0), t, np.zeros(len(t)))
    return Study("still", Setup(RobotSetup("joint-1d")), (trial,))


def by_activity(seconds: float = 30.0) -> Study:
    """Two trials whose stiffness is 40 + 50 emg, emg a slow wander of its own in each."""
    t = np.arange(0, seconds, 1 / RATE)
    trials = []
    for k in range(2):
        activity = 0.5 + 0.5 * np.sin(2 * np.pi * (t / 9.0 + 0.3 * k)) * np.cos(2 * np.pi * t / 23.0)
        trials.append(one(f"joint_{k + 1:02d}", 10 + k, 40.0 + 50.0 * activity, t, activity))
    return Study("activity", Setup(RobotSetup("joint-1d")), tuple(trials))


def with_cues(period_s: float = 5.0, seconds: float = 40.0) -> Study:
    """Every `period_s` a cue, after which stiffness jumps up by 30 and comes back with exp(-s)."""
    t = np.arange(0, seconds, 1 / RATE)
    s = np.mod(t, period_s)
    cue = ((s < 0.2) & (t >= 1.0)).astype(np.float64)
    trials = tuple(
        one(f"joint_{k + 1:02d}", 20 + k, 50.0 + 30.0 * np.exp(-((s - 1.5) ** 2)), t, cue) for k in range(2)
    )
    return Study("cues", Setup(RobotSetup("joint-1d")), trials)
