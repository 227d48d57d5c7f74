"""What a periodic perturbation tells beyond M, B and K: the best linear approximation, noise and distortion.

The period is exact in rows of the robot's log, whose clock plays the perturbation; on the module's clock it
is not, so the signals are read at the log's instants.

Source: R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, ch. 4.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.arrays import Complexes, Floats
from impid_host.impedance.spectral.best_linear import BestLinearApproximation, best_linear_approximation
from impid_host.impedance.spectral.distortion import DistortionLevels, distortion_levels
from impid_host.signals.spline import Spline

Harmonics = np.ndarray[tuple[int], np.dtype[np.int64]]
# A log rounds its numbers; random noise never repeats itself this well.
_REPEATS = 0.9999
_SHORTEST_ROWS = 100
# Lines of a multisine stand this far above what rounding leaves in the gaps.
_EXCITED_SHARE = 0.05
_LARGEST_CONDITION = 1e3


@dataclass(frozen=True, slots=True)
class PeriodicTrial:
    """One trial on the robot's clock.

    Attributes:
        t: s, shape (N,); force: of the robot on the load, N; displacement: m; shape (N, n).
        log_t: of the log's rows, s, shape (R,); command: N, shape (R, n).
    """

    t: Floats
    force: Floats
    displacement: Floats
    log_t: Floats
    command: Floats


@dataclass(frozen=True, slots=True)
class Periodic:
    """The evaluation.

    Attributes:
        compliance: best linear approximation from force to displacement, m/N.
        distortion: of the displacement along each axis, beyond what the force explains linearly.
        period_s: of the perturbation.
    """

    compliance: BestLinearApproximation
    distortion: tuple[DistortionLevels, ...]
    period_s: float


def period_rows(command: Floats | None) -> int | None:
    """Rows after which a logged perturbation repeats itself, or None."""
    if command is None or len(command) < 3 * _SHORTEST_ROWS or not np.all(np.isfinite(command)):
        return None
    n = len(command)
    spectrum = np.fft.rfft(command, 2 * n, axis=0)
    overlap = np.fft.irfft(np.abs(spectrum) ** 2, axis=0)[:n].sum(axis=1)
    power = np.concatenate([[0.0], np.cumsum(np.sum(command**2, axis=1))])
    lags = np.arange(n)
    both = np.sqrt((power[n] - power[lags]) * power[n - lags])
    likeness = np.divide(overlap, both, out=np.zeros(n), where=both > 1e-9 * power[n])
    found = np.flatnonzero(likeness[_SHORTEST_ROWS : n // 2] > _REPEATS)
    if len(found) == 0:
        return None
    # Neighbours of the period are nearly as alike: take the best of the first group.
    first = found[: np.argmax(np.append(np.diff(found), 2) > 1) + 1] + _SHORTEST_ROWS
    return int(first[np.argmax(likeness[first])])


def evaluate_periodic(trials: Sequence[PeriodicTrial], rows: int) -> Periodic | None:
    """All trials in the order of their names: of n axes, n successive trials are one realisation.

    Returns:
        None where that does not make whole realisations, two of them at least, with two steady periods each.

    Raises:
        UndeterminedError: the multisines have no free odd lines.
    """
    n = trials[0].force.shape[1]
    steady = [_steady(trial, rows) for trial in trials]
    periods = min(part[0].shape[0] for part in steady)
    realisations = len(trials) // n
    if realisations < 2 or realisations * n != len(trials) or periods < 2:
        return None
    force, motion = (
        np.stack([part[k][-periods:] for part in steady]).reshape(realisations, n, periods, rows, n)
        for k in (0, 1)
    )
    reference = np.stack([part[2] for part in steady]).reshape(realisations, n, rows, n)
    lines = np.abs(np.fft.rfft(reference, axis=2))
    strength = np.sqrt(np.mean(lines**2, axis=(0, 1, 3)))
    harmonics: Harmonics = np.flatnonzero(strength > _EXCITED_SHARE * strength.max()).astype(np.int64)
    matrices = np.moveaxis(np.fft.rfft(reference, axis=2)[:, :, harmonics], 1, -1)
    if np.max(np.linalg.cond(matrices)) > _LARGEST_CONDITION:
        return None
    rate = 1.0 / float(np.median(np.diff(trials[0].log_t)))
    approximation = best_linear_approximation(force, motion, rate, harmonics, reference)
    return Periodic(approximation, _distortion(approximation, force, motion, harmonics), rows / rate)


def _distortion(
    approximation: BestLinearApproximation, force: Floats, motion: Floats, harmonics: Harmonics
) -> tuple[DistortionLevels, ...]:
    """Per axis, over all trials; the response between the excited lines from the smooth dynamic stiffness."""
    lines = np.arange(1, int(harmonics.max()) + 1)
    known = np.ascontiguousarray(np.linalg.inv(approximation.G), dtype=np.complex128)
    parts = Spline(harmonics.astype(np.float64), known.view(np.float64))
    between = np.ascontiguousarray(parts(np.clip(lines, harmonics.min(), None).astype(np.float64)))
    stiffness: Complexes = between.view(np.complex128)
    response: Complexes = np.linalg.inv(stiffness).astype(np.complex128)
    flat = (-1, *motion.shape[2:])
    return tuple(
        distortion_levels(force.reshape(flat), motion.reshape(flat)[..., axis], harmonics, response[:, axis])
        for axis in range(motion.shape[4])
    )


def _steady(trial: PeriodicTrial, rows: int) -> tuple[Floats, Floats, Floats]:
    """Force and motion of all whole periods after the first, (P, rows, n) each, and one period's command."""
    begin, end = float(trial.t[0]), float(trial.t[-1])
    inside = np.flatnonzero((trial.log_t >= max(begin, trial.log_t[rows])) & (trial.log_t <= end))
    count = len(inside) // rows
    if count == 0 or inside[-1] - inside[0] + 1 != len(inside):
        raise UndeterminedError("a periodic perturbation needs two whole periods in one piece")
    first = int(inside[0]) + len(inside) - count * rows
    # Rows that a multiple of the period apart play the same: begin where the first period did.
    first -= (first - rows) % rows
    while trial.log_t[first] < begin:
        first += rows
    count = (int(inside[-1]) + 1 - first) // rows
    at = trial.log_t[first : first + count * rows]
    force, motion = (
        Spline(trial.t, x)(at).reshape(count, rows, -1) for x in (trial.force, trial.displacement)
    )
    command = trial.command[first : first + count * rows].reshape(count, rows, -1).mean(axis=0)
    return force, motion, command
