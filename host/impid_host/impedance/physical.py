"""Inertias that a body can have: of all robots whose links could be built, the one that explains most.

A link's ten inertial parameters are possible when its pseudo-inertia P = [[S, h], [h', m]] is positive
definite, S being the second moments of its mass, h the first, m the mass (Wensing, Kim and Slotine, IEEE RA-L
3, 2018). The free trials' weighted least squares under that condition is a convex programme. It is solved by
Newton's method with a weak entropic pull towards a plain ball, -log det P + trace(P0^-1 P) (Lee, Wensing and
Park, IEEE T-RO 36, 2020), which keeps P inside and settles what no motion shows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impid_host.errors import UndeterminedError
from impid_host.impedance.identify import RobotFit, robot_rows
from impid_host.impedance.rows import Split, series
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import Chain

_PULLS = tuple(10.0**power for power in range(6, -3, -1))  # of the entropy, against rows of unit variance
_BALL_KG, _BALL_RADIUS_M = 1.0, 0.1
_STEPS = 200  # of Newton, for each pull
_SETTLED = 1e-10
_BACKTRACK = 0.5
_ARMIJO = 1e-4


@dataclass(frozen=True, slots=True)
class PhysicalRobot:
    """The nearest possible robot.

    Attributes:
        value: of the structure's parameters, (p,).
        links: m, mx, my, mz (kg, kg m), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the link's origin (kg m^2) of each
            link, (n, 10): one set of many that move alike.
        worse_percent: rise of the fitted rows' residual, weighted by joint, over the least there is.
        vaf, rms: as the RobotFit's.
    """

    value: Floats
    links: Floats
    worse_percent: float
    vaf: Floats
    rms: Floats


def physical_robot(
    fit: RobotFit, trials: Sequence[AlignedTrial], chain: Chain, split: Split
) -> PhysicalRobot:
    """The possible robot nearest to a fit of free trials.

    Raises:
        UndeterminedError: the robot's model does not know its links.
    """
    structure = fit.parameters.structure
    grouping = structure.model.link_inertias
    if grouping is None:
        raise UndeterminedError(
            f"robot model {structure.model.name} has no links whose inertias could be checked; "
            'physical consistency goes with model = "urdf"'
        )
    equations, rows = robot_rows(trials, structure, chain, split)
    weight = 1 / np.maximum(fit.estimate.residual_rms, 1e-300)
    design = np.concatenate([part.design * weight[:, None] for part in rows])
    target = np.concatenate([part.target * weight for part in rows])
    flat, aim = design.reshape(-1, design.shape[2]), target.ravel()
    links, rest = _possible(flat, aim, grouping, structure.nonnegative)
    value = np.concatenate([grouping @ links, rest])
    size = np.maximum(np.linalg.norm(flat, axis=0), 1e-300)
    least = aim - (flat / size) @ np.linalg.lstsq(flat / size, aim, rcond=1e-10)[0]
    shown = [series(equation, value, split.masks(equation.trial, chain)[1]) for equation in equations]
    return PhysicalRobot(
        value=value,
        links=links.reshape(-1, 10),
        worse_percent=100
        * (float(np.linalg.norm(aim - flat @ value)) / max(float(np.linalg.norm(least)), 1e-300) - 1),
        vaf=np.mean([part.vaf() for part in shown], axis=0),
        rms=np.sqrt(np.mean([part.rms() ** 2 for part in shown], axis=0)),
    )


def pseudo_inertia(link: Floats) -> Floats:
    """P (4, 4) of ten parameters m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz; kg, kg m, kg m^2."""
    m, mx, my, mz, xx, xy, yy, xz, yz, zz = link
    trace = 0.5 * (xx + yy + zz)
    return np.array(
        [
            [trace - xx, -xy, -xz, mx],
            [-xy, trace - yy, -yz, my],
            [-xz, -yz, trace - zz, mz],
            [mx, my, mz, m],
        ]
    )


_UNITS = np.stack([pseudo_inertia(row) for row in np.eye(10)])


def _possible(
    design: Floats, target: Floats, grouping: Floats, nonnegative: Sequence[bool]
) -> tuple[Floats, Floats]:
    """Link parameters (10 n,) and the others (k,): `design` (N, b + k) against `target` (N,)."""
    from scipy import linalg  # noqa: PLC0415  (a tenth of a second, which starting can do without)

    b, many = grouping.shape
    Q, R = linalg.qr(design, mode="economic")
    aim = Q.T @ target
    # What moves nothing stays at zero.
    shown = np.linalg.norm(R[:, b:], axis=0) > 1e-9 * max(float(np.linalg.norm(R)), 1e-300)
    other = R[:, b:][:, shown]
    positive: NDArray[np.intp] = many + np.flatnonzero(np.array(nonnegative[b:], dtype=bool)[shown])
    A = np.concatenate([R[:, :b] @ grouping, other], axis=1)
    ball = np.zeros(10)
    ball[0] = _BALL_KG
    ball[[4, 6, 9]] = 0.4 * _BALL_KG * _BALL_RADIUS_M**2
    z = np.zeros(A.shape[1])
    z[:many], z[positive] = np.tile(ball, many // 10), 1.0
    entropy = _Entropy(
        many // 10, np.asarray(np.linalg.inv(pseudo_inertia(ball)), dtype=np.float64), positive
    )
    for pull in _PULLS:
        z = _newton(z, A, aim, entropy, pull)
    rest = np.zeros(len(shown))
    rest[shown] = z[many:]
    return z[:many], rest


@dataclass(frozen=True, slots=True)
class _Entropy:
    """-log det P + trace(P0^-1 P) over n links, and -log of what cannot be negative."""

    links: int
    inverse_ball: Floats
    positive: NDArray[np.intp]

    def value(self, z: Floats) -> float:
        """Infinite where a link is impossible."""
        if np.any(z[self.positive] <= 0):
            return float("inf")
        total = -float(np.sum(np.log(z[self.positive])))
        for k in range(self.links):
            P = pseudo_inertia(z[10 * k : 10 * k + 10])
            lowest = np.linalg.eigvalsh(P)
            if lowest[0] <= 0:
                return float("inf")
            total += float(np.sum(self.inverse_ball * P) - np.sum(np.log(lowest)))
        return total

    def slopes(self, z: Floats) -> tuple[Floats, Floats]:
        """Gradient (v,), and C with C'C the Hessian, (16 n + positives, v)."""
        gradient = np.zeros(len(z))
        root = np.zeros((16 * self.links + len(self.positive), len(z)))
        gradient[self.positive] = -1 / z[self.positive]
        root[16 * self.links + np.arange(len(self.positive)), self.positive] = 1 / z[self.positive]
        for k in range(self.links):
            part = slice(10 * k, 10 * k + 10)
            half = np.linalg.inv(np.linalg.cholesky(pseudo_inertia(z[part])))
            turned = half @ _UNITS @ half.T
            gradient[part] = np.einsum("ij,kij->k", self.inverse_ball, _UNITS) - np.trace(
                turned, axis1=1, axis2=2
            )
            root[16 * k : 16 * k + 16, part] = turned.reshape(10, 16).T
        return gradient, root


def _newton(z: Floats, A: Floats, aim: Floats, entropy: _Entropy, pull: float) -> Floats:
    """Minimum of 1/2 |A z - aim|^2 + pull * entropy, by damped steps.

    Steps by QR of the Hessian's root: formed as A'A it would lose half of its digits and the descent.
    """

    from scipy import linalg  # noqa: PLC0415  (a tenth of a second, which starting can do without)

    def cost(point: Floats) -> float:
        return 0.5 * float(np.sum((A @ point - aim) ** 2)) + pull * entropy.value(point)

    for _ in range(_STEPS):
        slope, root = entropy.slopes(z)
        gradient = A.T @ (A @ z - aim) + pull * slope
        stacked = np.concatenate([A, np.sqrt(pull) * root])
        size = np.maximum(np.linalg.norm(stacked, axis=0), 1e-300)
        (R,) = linalg.qr(stacked / size, mode="r")[:1]
        R = R[: len(z)]
        inner = linalg.solve_triangular(R, gradient / size, trans="T")
        step = -linalg.solve_triangular(R, inner) / size
        gain = float(-gradient @ step)
        here, share = cost(z), 1.0
        if gain < _SETTLED * (1 + abs(here)):
            break
        while cost(z + share * step) > here - _ARMIJO * share * gain and share > 1e-12:
            share *= _BACKTRACK
        z = z + share * step
    return z
