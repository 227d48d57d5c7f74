"""Maps of angles: what a mistake did to them, undone; and the hypothesis that a map makes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from impid_host.checks.check import Change
from impid_host.checks.factors import Factor, nearest
from impid_host.checks.mistakes.hypothesis import Hypothesis
from impid_host.checks.signals import Signals
from impid_host.signals.arrays import Floats

LEAST_ZERO = 0.05
LEAST_SCALE = 0.02
LOG = "robot.csv, or the mapping it is imported by"


@dataclass(frozen=True, slots=True)
class Relation:
    """controller = slope * module + zero of one joint, over all trials."""

    slope: float
    zero: float
    left: float


def relation(study: Signals, robot_joint: int, module_joint: int) -> Relation | None:
    """Least squares over all trials with one zero; None without a module or without motion."""
    pairs = [
        (trial.counted[:, module_joint], trial.angles[:, robot_joint])
        for trial in study.trials
        if trial.counted is not None and module_joint < trial.counted.shape[1]
    ]
    if not pairs:
        return None
    m, r = (np.concatenate(part) for part in zip(*pairs, strict=True))
    if np.std(m) < 1e-6 or np.std(r) < 1e-6:
        return None
    slope = float(np.cov(m, r)[0, 1] / np.var(m, ddof=1))
    zero = float(np.mean(r) - slope * np.mean(m))
    return Relation(slope, zero, float(np.std(r - slope * m - zero) / np.std(r)))


def joint_sets(n: int) -> list[tuple[int, ...]]:
    """Each joint, and all of them."""
    single: list[tuple[int, ...]] = [(joint,) for joint in range(n)]
    return single if n == 1 else [*single, tuple(range(n))]


def apart(study: Signals, joint: int, found: Relation) -> float:
    """Controller minus module where their slope is 1 and their zeros are apart; else 0."""
    if abs(found.slope - 1) > LEAST_SCALE:
        return 0.0
    apart = float(
        np.mean(
            [(t.angles[:, joint] - t.counted[:, joint]).mean() for t in study.trials if t.counted is not None]
        )
    )
    return apart if abs(apart) > LEAST_ZERO else 0.0


def factor_of(slope: float) -> Factor:
    return nearest(slope) or Factor(float(f"{slope:.4g}"), f"{slope:.4g}")


Angles = Callable[[Floats], Floats]


def second_with_first(theta: Floats, *, sign: float, shift: float = 0.0) -> Floats:
    """theta2 + sign theta1 + shift in the place of theta2."""
    return np.stack([theta[:, 0], theta[:, 1] + sign * theta[:, 0] + shift], axis=1)


def moved(theta: Floats, *, by: dict[int, float]) -> Floats:
    """Constants added to some joints."""
    theta = theta.copy()
    for joint, offset in by.items():
        theta[:, joint] += offset
    return theta


def divided(theta: Floats, *, by: float) -> Floats:
    return theta / by


def on_joint(joint: int, change: Angles) -> Angles:
    def mend(theta: Floats) -> Floats:
        theta = theta.copy()
        theta[:, joint] = change(theta[:, joint])
        return theta

    return mend


def on_joints(joints: tuple[int, ...], change: Callable[[Floats, int], Floats]) -> Angles:
    def mend(theta: Floats) -> Floats:
        theta = theta.copy()
        for joint in joints:
            theta[:, joint] = change(theta[:, joint], joint)
        return theta

    return mend


def counted(
    what: str,
    where: str,
    words: str,
    change: Angles,
    remedy: str,
    changes: tuple[Change, ...] = (),
    odds: float = 0.0,
) -> Hypothesis:
    return Hypothesis(
        what, where, words, lambda study: study.mapped(counted=change), remedy, changes, odds, one_trial=True
    )


def logged(what: str, where: str, words: str, change: Angles, remedy: str, odds: float = 0.0) -> Hypothesis:
    return Hypothesis(
        what,
        where,
        words,
        lambda study: study.mapped(angles=change),
        f"{LOG}: {remedy}",
        odds=odds,
        one_trial=True,
    )


def everywhere(
    what: str,
    where: str,
    words: str,
    change: Angles,
    remedy: str,
    changes: tuple[Change, ...] = (),
    odds: float = 0.0,
) -> Hypothesis:
    return Hypothesis(
        what,
        where,
        words,
        lambda study: study.mapped(counted=change, angles=change),
        remedy,
        changes,
        odds,
    )
