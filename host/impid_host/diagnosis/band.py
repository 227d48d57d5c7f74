"""The band in which accelerations by the encoders are signal: coarser counters make it narrower.

What a counter's steps leave, differentiated twice, grows with the fourth power of frequency, enters through
the robot's inertia, and is the same noise in the regressors and in what they leave: there it passes for
effects (errors in variables).
"""

from collections.abc import Sequence

import numpy as np
from scipy import signal

from impid_host.diagnosis.holdout import FIT, Holdout
from impid_host.effects.view import View
from impid_host.signals.arrays import Floats, Mask

WIDEST_HZ = 11.0
_NARROWEST_HZ = 5.0
_QUICKEST_HZ = 40.0
_MOST_OF_SPEED = 0.999  # of its power
_PART = 0.05  # of the torque's own noise density: most that the encoders' may be at the band's end
_NOISE_HZ = (25.0, 45.0)  # above all motion, below the filter that the views have passed


def band_hz(views: Sequence[View], holdout: Holdout) -> float:
    """Cut-off for all trials alike, Hz, by the fit part of each."""
    return min((_band(view, holdout.mask(view, FIT)) for view in views), default=WIDEST_HZ)


def quick_band_hz(views: Sequence[View], holdout: Holdout) -> float:
    """The same for a joint that is shaken as such: as wide as its motion is, by its speed.

    A perturbed human joint moves up to some 30 Hz, and its inertia shows nowhere but there.
    """
    ends = []
    for view in views:
        rows = holdout.mask(view, FIT)
        for joint in range(view.joints if rows.sum() > 1024 else 0):
            frequency, power = signal.welch(view.omega[rows, joint], view.rate_hz, nperseg=1024)
            share = np.cumsum(power) / max(float(power.sum()), 1e-300)
            ends.append(float(frequency[np.searchsorted(share, _MOST_OF_SPEED)]))
    return float(np.clip(max(ends, default=0.0), WIDEST_HZ, _QUICKEST_HZ))


def _band(view: View, rows: Mask) -> float:
    if view.rate_hz < 2.2 * _NOISE_HZ[1] or rows.sum() < 4 * view.rate_hz:
        return WIDEST_HZ
    result = WIDEST_HZ
    for joint in range(view.joints):
        frequency, acc = _density(view.acc[rows, joint], view.rate_hz)
        angle = float(np.median(acc / (2 * np.pi * frequency) ** 4))
        torque = float(np.median(_density(view.tau[rows, joint], view.rate_hz)[1]))
        motion = np.column_stack([view.acc[rows], view.theta[rows], np.ones(int(rows.sum()))])
        inertia = float(np.linalg.lstsq(motion, view.tau[rows, joint], rcond=1e-10)[0][joint])
        limit = (_PART * torque / max(inertia**2 * angle, 1e-300)) ** 0.25 / (2 * np.pi)
        result = min(result, limit)
    return float(max(result, _NARROWEST_HZ))


def _density(values: Floats, rate_hz: float) -> tuple[Floats, Floats]:
    """Frequencies above all motion, and the power density there."""
    frequency, power = signal.welch(values, rate_hz, nperseg=min(len(values), int(2 * rate_hz)))
    inside = (frequency > _NOISE_HZ[0]) & (frequency < _NOISE_HZ[1])
    return frequency[inside], power[inside]
