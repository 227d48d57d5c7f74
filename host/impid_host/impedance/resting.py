"""Joints that rest: held by a brake, a drive or dry friction, they show nothing of themselves.

What an encoder or a drive lets tremble in a joint that is held is no motion. Taken for one, it made a viscous
friction of 8644 N m s/rad with a narrow interval.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.rows import finish
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.band import RESTS
from impid_host.signals.chain import Chain


def moving_joints(
    trials: Sequence[AlignedTrial], prismatic: Sequence[bool], chain: Chain
) -> tuple[tuple[int, ...], list[AlignedTrial]]:
    """Joints that move in some trial, from 0, and the trials with those still that rest.

    Raises:
        UndeterminedError: nothing moves in any trial.
    """
    if len(prismatic) == 1:
        return (0,), list(trials)
    speeds = np.array([_speed(trial, chain) for trial in trials])
    if not speeds.max() > 0:
        raise UndeterminedError("no joint moves in these trials")
    rests = speeds < RESTS * speeds.max()
    moving = tuple(int(joint) for joint in np.flatnonzero(~rests.all(axis=0)))
    return moving, [_still(trial, rest) for trial, rest in zip(trials, rests, strict=True)]


def _speed(trial: AlignedTrial, chain: Chain) -> Floats:
    """rms velocity per joint in the estimation band, (n,)."""
    omega = finish(chain, trial.omega, trial.rate_hz)
    rows = omega[trial.valid] if trial.valid.any() else omega
    result: Floats = np.sqrt(np.mean(rows**2, axis=0))
    return result


def _still(trial: AlignedTrial, rests: Mask) -> AlignedTrial:
    if not rests.any():
        return trial
    theta, omega, theta_dd = (values.copy() for values in (trial.theta, trial.omega, trial.theta_dd))
    theta[:, rests] = theta[:, rests].mean(axis=0)
    omega[:, rests] = 0.0
    theta_dd[:, rests] = 0.0
    return replace(trial, theta=theta, omega=omega, theta_dd=theta_dd)
