"""An arm's M and K made symmetric and positive definite, beside the unconstrained result, not instead.

The constrained parameters are those nearest to the unconstrained ones in the metric of their covariance,
which for linear least squares is the constrained least-squares solution. Their distance, chi-square with as
many degrees of freedom as there are symmetry conditions, says whether the data bear the constraint.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from impid_host.errors import UndeterminedError
from impid_host.impedance.identify import LoadFit
from impid_host.impedance.linear import Estimate
from impid_host.impedance.loads import LoadModel
from impid_host.impedance.matrices import Matrices, load_matrices
from impid_host.signals.arrays import Floats

_SMALLEST_EIGENVALUE = 1e-6  # of the largest: what a matrix on the boundary keeps


@dataclass(frozen=True, slots=True)
class Constrained:
    """A load's matrices under the constraint.

    Attributes:
        chi2, p_value: of symmetry against the unconstrained result.
        on_boundary: matrices ("M", "K") that symmetry alone left indefinite and that were moved to the
            boundary; their intervals are those of the symmetric solution and too narrow.
    """

    load: str
    method: str
    matrices: Matrices
    chi2: float
    p_value: float
    on_boundary: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """One sentence."""
        if self.p_value < 0.05:
            words = f"the data speak against symmetry (p = {self.p_value:.2g})"
        else:
            words = f"symmetry agrees with the data (p = {self.p_value:.2g})"
        if self.on_boundary:
            words += f"; {' and '.join(self.on_boundary)} had to be moved to be positive definite"
        return words


def constrain(fit: LoadFit, handle_mass_kg: float) -> Constrained:
    """Symmetric, positive definite M and K nearest to the unconstrained ones.

    Args:
        handle_mass_kg: as for the fit itself; definiteness is that of M with the handle taken off.

    Raises:
        UndeterminedError: the load's model has nothing to constrain (one axis, or a mass-spring load).
    """
    load, estimate = fit.model, fit.estimate
    if load.name != "arm" or len(load.axes) < 2:
        raise UndeterminedError(f"load {fit.load}: symmetry is a question for arms of two or more axes only")
    conditions = np.concatenate([_asymmetry(load, "a"), _asymmetry(load, "x")])
    onto = _projection(estimate.covariance, conditions)
    value = onto @ estimate.value
    gap = conditions @ estimate.value
    chi2 = float(gap @ np.linalg.solve(conditions @ estimate.covariance @ conditions.T, gap))
    handle = handle_mass_kg if load.carries_handle else 0.0
    moved = [name for name, S in _maps(load).items() if _smallest(S, value, load, handle, name) <= 0]
    if moved:
        value = _definite(estimate, load, handle)
    symmetric = replace(
        estimate,
        value=value,
        covariance=onto @ estimate.covariance @ onto.T,
        covariance_spread=onto @ estimate.covariance_spread @ onto.T,
    )
    return Constrained(
        load=fit.load,
        method=fit.method,
        matrices=load_matrices(load, symmetric, handle_mass_kg),
        chi2=chi2,
        p_value=float(special.chdtrc(len(conditions), chi2)),
        on_boundary=tuple(moved),
    )


def _maps(load: LoadModel) -> dict[str, Floats]:
    return {"M": load.matrix_map("a"), "K": load.matrix_map("x")}


def _asymmetry(load: LoadModel, signal: str) -> Floats:
    """Rows whose product with the parameters must vanish."""
    S, d = load.matrix_map(signal), len(load.axes)  # type: ignore[arg-type]
    return np.array([S[d * i + j] - S[d * j + i] for i in range(d) for j in range(i + 1, d)])


def _projection(covariance: Floats, conditions: Floats) -> Floats:
    """P with P @ value the nearest value that has conditions @ value = 0, (p, p)."""
    across = conditions @ covariance
    gain = np.linalg.solve(across @ conditions.T, across).T
    result: Floats = np.eye(len(covariance)) - gain @ conditions
    return result


def _smallest(S: Floats, value: Floats, load: LoadModel, handle: float, name: str) -> float:
    d = len(load.axes)
    own = handle * np.eye(d) if name == "M" else 0.0
    return float(np.linalg.eigvalsh((S @ value).reshape(d, d) - own)[0])


def _definite(estimate: Estimate, load: LoadModel, handle: float) -> Floats:
    """The nearest parameters with M - handle and K positive definite, by their Cholesky factors."""
    from scipy import optimize  # noqa: PLC0415  (a fifth of a second)

    d = len(load.axes)
    lower = np.tril_indices(d)
    fixed = _maps(load)
    inside = np.concatenate([np.flatnonzero(S.any(axis=0)) for S in fixed.values()])
    outside = np.setdiff1d(np.arange(len(estimate.value)), inside)
    root = np.linalg.cholesky(np.linalg.inv(estimate.covariance)).T

    def assemble(free: Floats) -> Floats:
        value = np.zeros(len(estimate.value))
        value[outside] = free[: len(outside)]
        for k, (name, S) in enumerate(fixed.items()):
            L = np.zeros((d, d))
            begin = len(outside) + k * len(lower[0])
            L[lower] = free[begin : begin + len(lower[0])]
            matrix = L @ L.T + (handle * np.eye(d) if name == "M" else 0.0)
            value += S.T @ matrix.ravel()
        return value

    start = [estimate.value[outside]]
    for name, S in fixed.items():
        matrix = (S @ estimate.value).reshape(d, d) - (handle * np.eye(d) if name == "M" else 0.0)
        level, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
        floor = max(float(np.abs(level).max()) * 1e-2, _SMALLEST_EIGENVALUE)
        start.append(np.linalg.cholesky((vectors * np.maximum(level, floor)) @ vectors.T)[lower])

    def distance(free: Floats) -> Floats:
        result: Floats = root @ (assemble(free) - estimate.value)
        return result

    solution = optimize.least_squares(distance, np.concatenate(start), x_scale="jac")
    return assemble(np.asarray(solution.x, dtype=np.float64))
