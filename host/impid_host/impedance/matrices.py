"""From a regression's parameters to the matrices M, B, K and the equilibrium, with their intervals."""

from dataclasses import dataclass

import numpy as np

from impid_host.impedance.linear import Estimate
from impid_host.impedance.loads import LoadModel, Signal
from impid_host.signals.arrays import Floats


@dataclass(frozen=True, slots=True)
class Quantity:
    """A vector or matrix with its 95 % interval: `ci95` has one more axis (low, high) than `value`.

    `sd` is the standard deviation of each entry, shaped like `value`; zero where the model fixes the entry.
    """

    value: Floats
    ci95: Floats
    unit: str
    sd: Floats


@dataclass(frozen=True, slots=True)
class Matrices:
    """M, B, K, (d, d), and x0, (d,); B is None where the model has none."""

    M: Quantity
    B: Quantity | None
    K: Quantity
    x0: Quantity


def load_matrices(load: LoadModel, estimate: Estimate, handle_mass_kg: float = 0.0) -> Matrices:
    """The matrices behind an estimate of `load`, the handle taken off M where it moves with the load."""
    handle = handle_mass_kg if load.carries_handle else 0.0
    M = _matrix(load, estimate, "a")
    own = handle * np.eye(len(load.axes))
    return Matrices(
        M=Quantity(M.value - own, M.ci95 - own[:, :, None], M.unit, M.sd),
        B=_matrix(load, estimate, "v") if load.has("v") else None,
        K=_matrix(load, estimate, "x"),
        x0=equilibrium(load, estimate),
    )


def mapped(estimate: Estimate, slope: Floats, value: Floats, unit: str, shape: tuple[int, ...]) -> Quantity:
    """Values (k,) whose derivative by the parameters is `slope` (k, q), as a Quantity of the given shape."""
    sd = np.sqrt(np.einsum("kp,pq,kq->k", slope, estimate.covariance, slope))
    half = estimate.half_width(slope)
    interval = np.stack([value - half, value + half], axis=1)
    return Quantity(value.reshape(shape), interval.reshape(*shape, 2), unit, sd.reshape(shape))


def equilibrium(load: LoadModel, estimate: Estimate) -> Quantity:
    """x0 = K^-1 (K x0) with its interval by the delta method, m (rad)."""
    S = load.matrix_map("x")
    d = len(load.axes)
    K = (S @ estimate.value).reshape(d, d)
    x0: Floats = np.linalg.solve(K, estimate.value[load.place]).astype(np.float64)
    # d x0 = K^-1 (d c - dK x0)
    slope: Floats = np.zeros((d, len(estimate.value)))
    slope[:, load.place] = np.eye(d)
    slope -= np.einsum("ijq,j->iq", S.reshape(d, d, -1), x0)
    return mapped(estimate, np.linalg.solve(K, slope).astype(np.float64), x0, load.place_unit, (d,))


def _matrix(load: LoadModel, estimate: Estimate, signal: Signal) -> Quantity:
    S = load.matrix_map(signal)
    d = len(load.axes)
    return mapped(estimate, S, S @ estimate.value, load.unit(signal), (d, d))
