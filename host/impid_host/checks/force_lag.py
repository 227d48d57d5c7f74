"""By how much the force sensor's readings run behind the torques, s.

A sensor that is read in one instant, while the torques are means over a period or are held over it, is off
by a part of that period; filters of the sensor add theirs. Late by d, a spring of stiffness K shows a damping
that is K d too small.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.checks.equations import Motions, derivative, force_in_base, low
from impid_host.checks.joint_fit import JointFit, together
from impid_host.checks.signals import Signals, TrialSignals, changed
from impid_host.signals.arrays import Floats


@dataclass(frozen=True, slots=True)
class Lag:
    """The force sensor late by `seconds` (early below zero), with its standard deviation, s."""

    seconds: float
    sd: float


def force_lag(study: Signals, motions: Motions, robot: JointFit) -> Lag | None:
    """Regress the torque that the load takes on -J^T F and its rate, offset and dry friction per joint.

    Args:
        robot: found without the force sensor; None comes back where nothing moves under load.
    """
    parts = [(_rows(trial, study, motions, robot.alpha), trial) for trial in study.trials if _loaded(trial)]
    n = study.model.joints
    designs, targets = [], []
    for joint in range(n):
        for rows, _ in parts:
            rest, force, rate, beside = rows
            block = np.zeros((len(rest), 1 + n + 2 * n))
            block[:, 0], block[:, 1 + joint] = rate[:, joint], force[:, joint]
            block[:, 1 + n + 2 * joint : 3 + n + 2 * joint] = beside[:, joint]
            scale = max(float(np.std(np.concatenate([r[0][:, joint] for r, _ in parts]))), 1e-9)
            designs.append(block / scale)
            targets.append(rest[:, joint] / scale)
    if not designs:
        return None
    design, target = np.concatenate(designs), np.concatenate(targets)
    size = np.maximum(np.linalg.norm(design, axis=0), 1e-12)
    inverse = np.linalg.pinv((design / size).T @ (design / size))
    value = inverse @ ((design / size).T @ target) / size
    left = [t - d @ value for d, t in zip(designs, targets, strict=True)]
    noise = together(left) * float(np.mean(np.concatenate(left) ** 2))
    return Lag(float(value[0]), float(np.sqrt(noise * inverse[0, 0]) / size[0]))


def _loaded(trial: TrialSignals) -> bool:
    return trial.force is not None and trial.kind != "free"


def _rows(
    trial: TrialSignals, study: Signals, motions: Motions, alpha: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Torque that the load takes (R, n), -J^T F and its rate (R, n), offset and dry friction (R, n, 2)."""
    motion = motions.of(trial, study)
    p, n = len(alpha), study.model.joints
    J = low(study.model.jacobian(trial.theta))
    force = force_in_base(trial, study, motion.tip)
    rate = force_in_base(changed(trial, force=derivative), study, motion.tip)
    assert force is not None and rate is not None
    rest = low(trial.torque) - motion.robot[:, :, :p] @ alpha
    dry = np.stack([motion.robot[:, joint, p + n + joint] for joint in range(n)], axis=1)
    beside = np.stack([np.ones_like(dry), dry], axis=2)
    return rest, -np.einsum("kij,ki->kj", J, force), -np.einsum("kij,ki->kj", J, rate), beside
