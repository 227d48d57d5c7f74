"""How much a planned motion will tell about the robot's parameters, before it is run.

Source: L. Ljung, System Identification, ch. 13 (D-optimal experiments); for robots J. Swevers et al., IEEE
Trans. Robot. Autom. 13 (1997) 730-740.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.impedance.spectral.arrays import Floats


@dataclass(frozen=True, slots=True)
class Information:
    """What white torque noise leaves to be known.

    Attributes:
        matrix: Fisher information, shape (p, p), 1 / parameter units squared.
        log_det: natural logarithm of its determinant with every parameter in units of its own size, so that
            it compares motions; -inf when some combination stays unknown.
        condition: of the regressor with columns scaled to unit length; the loss of digits between parameters.
        predicted_sd: smallest standard deviation an unbiased estimate can have, in parameter units, shape
        (p,).
    """

    matrix: Floats
    log_det: float
    condition: float
    predicted_sd: Floats


def information(Y: Floats, torque_sd: Floats, size: Floats | None = None) -> Information:
    """Fisher information of a linear regression tau = Y alpha + white noise.

    Args:
        Y: regressor along the motion, shape (N, n, p).
        torque_sd: standard deviation of each joint's torque noise (N m), shape (n,).
        size: typical size of each parameter, for `log_det`, shape (p,); default ones.
    """
    weighted = (Y / torque_sd[:, np.newaxis]).reshape(-1, Y.shape[2])
    matrix = weighted.T @ weighted
    scale = np.ones(Y.shape[2]) if size is None else np.abs(size)
    sign, log_det = np.linalg.slogdet(matrix * np.outer(scale, scale))
    length = np.linalg.norm(weighted, axis=0)
    singular = np.linalg.svd(weighted / np.where(length > 0, length, 1.0), compute_uv=False)
    condition = float(singular[0] / singular[-1]) if singular[-1] > 0 and np.all(length > 0) else np.inf
    known = condition < 1.0 / np.sqrt(np.finfo(float).eps)
    sd = np.sqrt(np.diag(np.linalg.inv(matrix))) if known else np.full(Y.shape[2], np.inf)
    return Information(matrix, float(log_det) if sign > 0 and known else -np.inf, condition, sd)
