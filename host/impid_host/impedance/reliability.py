"""What of the parameters the motion shows, and what only the accelerometer's noise.

Regressors by the accelerometer and by the angles have the motion in common, but not their noise. A direction
in parameter space whose two regressors share less than half of its power is mostly noise (the reliability
ratio of Fuller 1987, sec. 1.1): least squares would shrink it by more than half, and no interval would tell.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impid_host.impedance.combinations import Combinations, combinations, combinations_left
from impid_host.impedance.linear import Stretch, enough_rows
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats
from impid_host.signals.filters import central_difference

_RELIABLE = 0.5
_RIDGE = 1e-12


def by_angles(trial: AlignedTrial) -> AlignedTrial:
    """The trial with its accelerations from the angles, by the difference of the velocities."""
    theta_dd = central_difference(trial.omega, trial.rate_hz)
    return replace(trial, theta_dd=theta_dd, a=central_difference(trial.v, trial.rate_hz), source="angles")


def what_noise_hides(
    rows: Sequence[Stretch], twins: Sequence[Stretch], names: Sequence[str]
) -> Combinations | None:
    """The combinations that are left when directions of mere noise are open, or None where there are none.

    Args:
        rows: by the accelerometer; twins: the same by the angles, or empty where there is nothing to compare.
            Rows too few for a fit are left to it to refuse.

    Raises:
        UndeterminedError: nothing moves, or nothing above the noise.
    """
    if not twins or not enough_rows(rows, len(names)):
        return None
    exact = combinations(rows, names)
    weak = noise_directions([exact.cut(stretch) for stretch in rows], [exact.cut(twin) for twin in twins])
    if weak.shape[1] == 0:
        return None
    embedded = np.zeros((len(names), weak.shape[1]))
    embedded[list(exact.kept)] = weak
    return combinations_left(np.concatenate([exact.unseen, embedded], axis=1), twins, _size(rows), names)


def noise_directions(rows: Sequence[Stretch], twins: Sequence[Stretch]) -> Floats:
    """Directions in parameter space along which rows and twins share less than half of the power, (p, k).

    The rows' columns must be independent.
    """
    from scipy import linalg  # noqa: PLC0415  (a tenth of a second, which starting can do without)

    X, Z = (np.concatenate([s.design.reshape(-1, s.design.shape[2]) for s in part]) for part in (rows, twins))
    size = _size(rows)
    X, Z = X / size, Z / size
    shared = X.T @ Z
    ratio, vectors = linalg.eigh(0.5 * (shared + shared.T), X.T @ X + _RIDGE * np.eye(len(size)))
    found: Floats = vectors[:, ratio < _RELIABLE] / size[:, None]
    return found


def _size(rows: Sequence[Stretch]) -> Floats:
    square = sum(np.einsum("ncp,ncp->p", stretch.design, stretch.design) for stretch in rows)
    result: Floats = np.sqrt(square)
    return result
