"""By how many nats more a trial would tell two linear explanations apart.

Expected log predictive difference of two Gaussian models with the same noise: half the squared distance of
what one of them predicts from all that the other could be fitted to. Its mean over both directions is half
of Jeffreys' J-divergence. Source: A. C. Atkinson and V. V. Fedorov, Biometrika 62 (1975) 57-70 (T-optimal
designs); H. Jeffreys, Proc. R. Soc. A 186 (1946) 453-461.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impid_host.signals.arrays import Floats

Index = NDArray[np.intp]
_RANK = 1e-10  # of a column's own length: less is rounding


@dataclass(frozen=True, slots=True)
class Member:
    """An explanation: which columns of the common design it has, (q,), and its value on them, (q,)."""

    columns: Index
    value: Floats


def triangle(rows: Floats) -> Floats:
    """The triangle (k, k) that stands for (N, k) rows in every sum of squares."""
    if len(rows) <= rows.shape[1]:
        return rows
    return np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)


def fitted(rows: Floats, target: Floats, columns: Index) -> tuple[Member, float]:
    """The explanation with these columns, fitted to rows (N, k) of unit noise; the squares that it leaves."""
    design = rows[:, columns]
    value = _solved(design, target)
    return Member(columns, value), float(np.sum((target - design @ value) ** 2))


def divergence(rows: Floats, truth: Member, rival: Index) -> float:
    """Nats by which `truth` predicts its own rows (N, k) better than the rival's columns, fitted to them."""
    told = rows[:, truth.columns] @ truth.value
    design = rows[:, rival]
    return 0.5 * float(np.sum((told - design @ _solved(design, told)) ** 2))


def added(known: Floats, fresh: Floats, one: Member, other: Member) -> float:
    """Nats by which fresh rows (N, k) would add to telling the two apart, mean of both directions.

    The rival is refitted to the known and the fresh rows together, whose noise has unit variance.
    """
    both = np.concatenate([known, fresh])
    gains = [
        divergence(both, truth, rival.columns) - divergence(known, truth, rival.columns)
        for truth, rival in ((one, other), (other, one))
    ]
    return max(0.5 * sum(gains), 0.0)


def least_added(known: Floats, fresh: Floats, pairs: Sequence[tuple[Member, Member]]) -> float:
    """Of several pairs the one that is told apart worst; zero without any."""
    return min((added(known, fresh, one, other) for one, other in pairs), default=0.0)


def _solved(design: Floats, target: Floats) -> Floats:
    size = np.linalg.norm(design, axis=0)
    alive = size > 0
    value = np.zeros(design.shape[1])
    if alive.any():
        scaled = design[:, alive] / size[alive]
        value[alive] = np.linalg.lstsq(scaled, target, rcond=_RANK)[0] / size[alive]
    return value
