"""Sums of squares of nested and rival models from Gram matrices of whitened rows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from impid_host.diagnosis.rows import Run
from impid_host.signals.arrays import Floats

_RIDGE = 1e-11


@dataclass(frozen=True, slots=True)
class Gram:
    """G = Z^T Z of Z = [target | columns]; rows: how many."""

    G: Floats
    rows: int


def gram(runs: Sequence[Run]) -> Gram:
    """Of all rows of the given runs."""
    width = runs[0].design.shape[1] + 1
    total = np.zeros((width, width))
    rows = 0
    for run in runs:
        used = np.flatnonzero(np.any(run.design != 0, axis=0))
        Z = np.column_stack([run.target, run.design[:, used]])
        index = np.concatenate([[0], used + 1])
        total[np.ix_(index, index)] += Z.T @ Z
        rows += len(Z)
    return Gram(total, rows)


def base_directions(fit: Sequence[Run], columns: int) -> Floats:
    """Orthonormal directions of the first `columns` columns over all rows, (rows, columns).

    By QR on the rows themselves: the signal is ten thousand times the noise, and a Gram matrix would square
    that.
    """
    design = np.concatenate([run.design[:, :columns] for run in fit])
    design = design / (np.linalg.norm(design, axis=0) + 1e-300)
    # Pivoted: a column that the others span would else leave an arbitrary direction to those behind it.
    Q, R, _ = linalg.qr(design, mode="economic", pivoting=True, check_finite=False)
    result: Floats = Q[:, np.abs(np.diag(R)) > 1e-9]
    return result


def solve(G: Floats, columns: Sequence[int]) -> tuple[Floats, float]:
    """Least-squares coefficients on the given columns, and the residual sum of squares."""
    index = np.asarray(columns, dtype=int) + 1
    A, b = G[np.ix_(index, index)], G[index, 0]
    size = np.sqrt(np.maximum(np.diag(A), 1e-300))
    A = A / np.outer(size, size) + _RIDGE * np.eye(len(size))
    if len(index) == 0:
        return np.zeros(0), float(G[0, 0])
    beta = np.linalg.solve(A, b / size) / size
    return beta, float(G[0, 0] - b @ beta)


def projected(G: Floats, columns: Sequence[int]) -> Floats:
    """G with the given columns swept out: what is left of target and candidates beside them."""
    index = np.asarray(columns, dtype=int) + 1
    A = G[np.ix_(index, index)]
    if len(index) == 0:
        return G
    size = np.sqrt(np.maximum(np.diag(A), 1e-300))
    A = A / np.outer(size, size) + _RIDGE * np.eye(len(size))
    B = G[index] / size[:, None]
    result: Floats = G - B.T @ np.linalg.solve(A, B)
    return result


def gain(P: Floats, G: Floats, columns: slice) -> float:
    """Drop of the residual sum of squares by a candidate's columns, P = projected(G, those in the model).

    A column that the model's columns span is left out: what is left of it is rounding.
    """
    index = np.arange(columns.start, columns.stop) + 1
    left = np.diag(P)[index] > 1e-7 * np.maximum(np.diag(G)[index], 1e-300)
    index = index[left]
    if len(index) == 0:
        return 0.0
    A, b = P[np.ix_(index, index)], P[index, 0]
    size = np.sqrt(np.diag(A))
    values, vectors = np.linalg.eigh(A / np.outer(size, size))
    good = values > 1e-6
    return float(np.sum((vectors[:, good].T @ (b / size)) ** 2 / values[good]))
