"""Many small linear systems at once, one for each instant."""

import numpy as np

from impid_host.signals.arrays import Floats


def solved(A: Floats, b: Floats) -> Floats:
    """X with A X = b at each instant: (N, n, n), (N, n, k) -> (N, n, k).

    Two by two by Cramer's rule, which costs a tenth of the factorisations.

    Raises:
        numpy.linalg.LinAlgError: a matrix is singular.
    """
    if A.shape[1:] != (2, 2):
        return np.asarray(np.linalg.solve(A, b), dtype=np.float64)
    (a11, a12), (a21, a22) = A.transpose(1, 2, 0)
    determinant = a11 * a22 - a12 * a21
    if not determinant.all():
        raise np.linalg.LinAlgError("Singular matrix")
    first, second = b[:, 0].T, b[:, 1].T
    result = np.empty(b.shape)
    result[:, 0] = ((a22 * first - a12 * second) / determinant).T
    result[:, 1] = ((a11 * second - a21 * first) / determinant).T
    return result
