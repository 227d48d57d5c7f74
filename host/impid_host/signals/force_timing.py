"""A force sensor that is read in one instant: its readings as the means over a row's period that all else is.

A smooth force is at every instant what its mean around it is, but for the mean's own small gain. What a
held command adds to it is a staircase: just after a step the reading has all of it, the mean centred there
half. So the part of the force that follows the command is half a period early.

Where a log has more rows than the sensor has readings, a reading is that of the first row that shows it.
"""

from dataclasses import dataclass, replace

import numpy as np

from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.density import power_density
from impid_host.signals.spline import Spline
from impid_host.study.model import ForceSensor, RobotLog

# The force follows a command directly, beside all springs and dampers, in the upper part of its band.
_UPPER_PART = 0.6
_POWER_BELOW = 0.98
_ALIKE = 0.95
_FEWEST_ROWS = 200


def as_means(log: RobotLog, sensor: ForceSensor) -> RobotLog:
    """The log with its force as a mean over each row's period, by whichever `[force_sensor] timing`."""
    if sensor.timing == "mean" or log.force is None or len(log) < _FEWEST_ROWS:
        return log
    known = np.asarray(np.isfinite(log.force).all(axis=1))
    first: Mask = known & first_of_reading(log.force)
    if first.sum() < _FEWEST_ROWS // 4:
        return log
    t, force = log.t[first], log.force[first]
    if log.perturbation is not None and np.any(log.perturbation):
        force = _averaged(force, log.perturbation[first], t)
    if not first.all():
        spline = Spline(t, force)(np.clip(log.t, t[0], t[-1]))
        force = np.where(known[:, None], spline, np.nan)
    return replace(log, force=force)


def first_of_reading(force: Floats) -> Mask:
    """The rows, (N,), of (N, 2) forces that show a new reading; all, unless each is held for some rows."""
    new = np.concatenate([[True], np.any(np.diff(force, axis=0) != 0.0, axis=1)])
    lengths = np.diff(np.flatnonzero(new))
    held = len(lengths) > _FEWEST_ROWS // 4 and np.median(lengths) > 1
    # Missing rows and readings that chance to be equal make multiples of the period or single odd ones.
    if held and np.mean(lengths % int(np.median(lengths)) == 0) > _ALIKE:
        return new
    return np.ones(len(force), dtype=bool)


def _averaged(force: Floats, command: Floats, t: Floats) -> Floats:
    """Readings beside a step as means around it: (N, 2) each.

    With the command p and the share S of it that the force follows at once, the mean is F - S (p[k] - p[k-1])
    / 2 just after a step; of the smooth rest it is F + F'' T^2 / 24.
    """
    found = following(force, command, t)
    if found is None:
        return force
    late = found.steps > 0.5  # read just before the row's command takes its place
    before = np.concatenate([command[:1], command[:-1]])
    part = (before if late else command) @ found.share.T
    half = 0.5 * (command - before) @ found.share.T
    smooth = force - part
    bend = np.diff(np.pad(smooth, ((1, 1), (0, 0)), mode="reflect", reflect_type="odd"), n=2, axis=0)
    return np.asarray(force + (half if late else -half) + bend / 24.0)


@dataclass(frozen=True, slots=True)
class Following:
    """How a force follows a held command.

    Attributes:
        share: of a step that it takes at once, (2, 2).
        steps: how late it takes it, in rows: 0 just after the row's command, 1/2 a mean centred on the row, 1
            just before the command is renewed; sd: of that.
    """

    share: Floats
    steps: float
    sd: float


def following(force: Floats, command: Floats, t: Floats) -> Following | None:
    """Regress a force on a command (N, 2 each), its last step and its integrals, in the band's upper part.

    What speed and displacement add follows the integrals. None where the command does not tell.
    """
    rate = 1.0 / float(np.median(np.diff(t)))
    from scipy import signal  # noqa: PLC0415  (half a second, for trials with forces and a perturbation)

    f, power = power_density(command, rate, min(1024, len(command)))
    reached = np.cumsum(power.sum(axis=1))
    if not reached[-1] > 0:
        return None
    top = float(f[np.searchsorted(reached, _POWER_BELOW * reached[-1])])
    top = float(np.clip(top, 8 * f[1], 0.45 * rate))
    band = signal.butter(3, (_UPPER_PART * top, top), "bandpass", fs=rate, output="sos")
    step = np.diff(command, axis=0, prepend=command[:1])
    once = np.cumsum(command, axis=0) - command
    twice = np.cumsum(once, axis=0) - 0.5 * once
    sources = np.concatenate([_scaled(x) for x in (command, step, once, twice)], axis=1)
    fast, target = (signal.sosfiltfilt(band, x, axis=0) for x in (sources, force))
    inverse = np.linalg.pinv(fast.T @ fast, rcond=1e-12)
    found = inverse @ (fast.T @ target)
    share, late = (found[:2] / _size(command)).T, (-found[2:4] / _size(step)).T
    if abs(np.linalg.det(share)) < 1e-4:
        return None
    left = float(np.mean((target - fast @ found) ** 2)) * rate / (0.8 * top)
    sd = np.sqrt(left * np.mean(np.diag(inverse)[2:4])) / _size(step) / np.linalg.norm(share, 2)
    return Following(share, float(np.trace(np.linalg.solve(share, late)) / 2), float(sd))


def _size(values: Floats) -> float:
    return max(float(np.abs(values).max()), 1e-300)


def _scaled(values: Floats) -> Floats:
    return np.asarray(values / _size(values))
