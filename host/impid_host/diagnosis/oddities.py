"""What is wrong with a log before any model is asked: torque that stands at its limit, or stands still."""

from dataclasses import dataclass

import numpy as np

from impid_host.signals.arrays import Floats, Mask
from impid_host.study.model import RobotLog

_LIMIT_S = 0.02  # a torque that holds its extreme value so long is cut off there
_STUCK_S = 0.03
_COARSE_S = 0.01  # a log that holds its values so long most of the time is coarsely rounded, not stuck
_COARSE_SHARE = 0.3
_LEAST_SHARE = 0.002


@dataclass(frozen=True, slots=True)
class Oddity:
    """Rows of a trial that cannot be believed.

    Attributes:
        share: of the trial's rows.
    """

    trial: str
    on: str
    share: float
    words: str


def odd_rows(name: str, log: RobotLog) -> tuple[Mask, list[Oddity]]:
    """Rows of the log to leave out (N,), and why."""
    period = float(np.median(np.diff(log.t)))
    bad = np.zeros(len(log), dtype=bool)
    found = []
    for joint in range(log.tau.shape[1]):
        tau = log.tau[:, joint]
        length = _run_lengths(tau) * period
        if np.mean(length > _COARSE_S) > _COARSE_SHARE:
            step = float(np.min(np.abs(np.diff(tau)[np.diff(tau) != 0]), initial=np.inf))
            words = f"{name}: the torque of joint {joint + 1} is logged in steps of {step:.2g}"
            found.append(Oddity(name, f"tau{joint + 1}", 0.0, words))
            continue
        moves = np.abs(np.gradient(log.theta[:, min(joint, log.theta.shape[1] - 1)])) > 0
        at_limit = (length > _LIMIT_S) & ((tau == tau.max()) | (tau == tau.min())) & (np.ptp(tau) > 0)
        stuck = (length > _STUCK_S) & ~at_limit & _around(moves, round(_STUCK_S / period))
        for rows, what in (
            (at_limit, "is cut off at its limit"),
            (stuck, "stands still while the joint moves"),
        ):
            if rows.mean() > _LEAST_SHARE:
                share = float(rows.mean())
                words = f"{name}: the torque log of joint {joint + 1} {what} in {100 * share:.1f} % of rows"
                found.append(Oddity(name, f"tau{joint + 1}", share, words))
                bad |= rows
    return bad, found


def _run_lengths(values: Floats) -> Floats:
    """For each row, how many rows in succession have its value."""
    edges = np.flatnonzero(np.diff(values) != 0) + 1
    cuts = np.concatenate([[0], edges, [len(values)]])
    lengths = np.diff(cuts)
    result: Floats = np.repeat(lengths, lengths).astype(np.float64)
    return result


def _around(flags: Mask, reach: int) -> Mask:
    kernel = np.ones(2 * max(reach, 1) + 1)
    result: Mask = np.convolve(flags.astype(float), kernel, mode="same") > 0.5 * len(kernel)
    return result
