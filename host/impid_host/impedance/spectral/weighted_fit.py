"""M, B and K from the cross-spectra themselves, each frequency weighted by its own noise.

[P]'s fit in dB and degrees is kept as published (`second_order`), but it has a price: where an element of Z
passes through zero its noisy gain in dB errs upwards, inverting C smears resonances through the window, and
every coherent frequency counts alike however much power it holds. The equation of motion is linear in M, B
and K,

    S_Fw = (K + j w B - w^2 M) S_dw + noise,

and stays so after averaging. Its weighted least-squares solution has none of the three troubles. w is the
instrument: the perturbation, or the force itself where no perturbation was logged.

Source: R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, ch. 9 (weighted and
instrumental-variable least squares in the frequency domain).
"""

from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.arrays import Complexes, Floats
from impid_host.impedance.spectral.frequency_response import noise_spectrum
from impid_host.impedance.spectral.second_order import SecondOrderFit

REWEIGHTINGS = 5


@dataclass(frozen=True, slots=True)
class CrossSpectra:
    """Averaged spectra in the fit's band, each shape (n_f, n, n); F in N, d in m, w in N.

    `Fw` and `dw` are with the instrument; `FF`, `Fd`, `dd` serve the residual's spectrum.
    """

    Fw: Complexes
    dw: Complexes
    ww: Complexes
    FF: Complexes
    Fd: Complexes
    dd: Complexes


def fit_cross_spectra(
    frequency_Hz: Floats, spectra: CrossSpectra, averages: float, error_correlation: Floats
) -> SecondOrderFit:
    """Weighted least squares for M, B and K, full matrices, with standard deviations.

    Args:
        frequency_Hz: positive frequencies, shape (n_f,).
        spectra: at those frequencies.
        averages: independent averages behind them.
        error_correlation: correlation of the estimates' errors between frequencies, shape (n_f, n_f).

    Returns:
        The fit; `cost` is the weighted squared residual, about n^2 n_f when the model holds and neighbouring
        frequencies are independent.

    Raises:
        UndeterminedError: fewer than three frequencies.
    """
    n_f, n, _ = spectra.Fw.shape
    if n_f < 3:
        raise UndeterminedError("fewer than three frequencies in the band: M, B and K cannot be told apart")
    omega = 2 * np.pi * frequency_Hz
    whitening = _inverse_root(spectra.ww)
    A, X = spectra.Fw @ whitening, spectra.dw @ whitening
    dof = max(averages - n, np.finfo(float).eps) / averages
    design = _design(omega, X)
    power = np.diagonal(spectra.FF, axis1=1, axis2=2).real
    variance = np.maximum(power, np.finfo(float).tiny)
    parameters = np.zeros((n, 3 * n))
    for _ in range(REWEIGHTINGS):
        for i in range(n):
            weight = 1.0 / np.sqrt(variance[:, i])
            rows = weight[:, np.newaxis, np.newaxis] * design
            target = weight[:, np.newaxis] * A[:, i]
            parameters[i] = np.linalg.lstsq(_real(rows), _real(target), rcond=None)[0]
        residual = _residual_spectrum(omega, parameters, spectra) / dof
        found = np.diagonal(residual, axis1=1, axis2=2).real
        # A noise-free record must not divide by zero; what lies this far below the force is rounding.
        variance = np.maximum(found, 1e-20 * power)
    covariance, cost = _covariance(design, A, parameters, residual, variance, averages, error_correlation)
    K, B, M = np.moveaxis(parameters.reshape(n, 3, n), 1, 0)
    sd = np.sqrt(np.diag(covariance)).reshape(3, n, n)
    return SecondOrderFit(
        M, B, K, sd[0], sd[1], sd[2], covariance, cost, (float(frequency_Hz[0]), float(frequency_Hz[-1]))
    )


def _design(omega: Floats, X: Complexes) -> Complexes:
    """Row of the regression for each frequency and instrument: (X_j, j w X_j, -w^2 X_j), shape (n_f, n, 3
    n).
    """
    Xt = np.swapaxes(X, 1, 2)
    jw = 1j * omega[:, np.newaxis, np.newaxis]
    return np.asarray(np.concatenate([Xt, jw * Xt, jw**2 * Xt], axis=2))


def _real(z: Complexes) -> Floats:
    """Real parts of all rows, then their imaginary parts; the last axis of a design stays."""
    columns = z.reshape(-1, z.shape[2]) if z.ndim == 3 else z.reshape(-1)
    return np.concatenate([columns.real, columns.imag])


def _residual_spectrum(omega: Floats, parameters: Floats, spectra: CrossSpectra) -> Complexes:
    """Spectrum of F - D d, shape (n_f, n, n)."""
    n = parameters.shape[0]
    K, B, M = np.moveaxis(parameters.reshape(n, 3, n), 1, 0)
    jw = 1j * omega[:, np.newaxis, np.newaxis]
    return noise_spectrum(K + jw * B + jw**2 * M, spectra.FF, spectra.Fd, spectra.dd)


def _covariance(
    design: Complexes,
    A: Complexes,
    parameters: Floats,
    residual: Complexes,
    variance: Floats,
    averages: float,
    correlation: Floats,
) -> tuple[Floats, float]:
    """Covariance of (M, B, K), row by row, and the weighted squared residual."""
    n_f, n, _ = A.shape
    root = _root(residual) / np.sqrt(averages)
    a = np.zeros((3, n, n, n_f, n, n), dtype=np.complex128)
    cost = 0.0
    for i in range(n):
        weight = 1.0 / np.sqrt(variance[:, i])
        rows = _real(weight[:, np.newaxis, np.newaxis] * design)
        # Columns differ by powers of w: scaled, the pseudo-inverse keeps all digits.
        size = np.linalg.norm(rows, axis=0)
        inverse = (np.linalg.pinv(rows / size) / size[:, np.newaxis]).reshape(3, n, 2, n_f, n)
        influence = (inverse[:, :, 0] - 1j * inverse[:, :, 1]) * weight[:, np.newaxis]
        # the error of row i of S_Fw is root[i, b] z[b, instrument]
        a[:, i] = np.einsum("qjfw,fb->qjfbw", influence, root[:, i])
        misfit = weight[:, np.newaxis] * (A[:, i] - design @ parameters[i])
        cost += averages * float(np.sum(np.abs(misfit) ** 2))
    flat = a[::-1].reshape(3 * n * n, n_f, n * n)
    covariance = 0.5 * np.einsum("pfc,fg,qgc->pq", np.conj(flat), correlation, flat, optimize=True).real
    return np.asarray(covariance), cost


def _root(S: Complexes) -> Complexes:
    """Hermitian square root, shape (n_f, n, n)."""
    value, vector = np.linalg.eigh(S)
    root = np.sqrt(np.clip(value, 0.0, None))[:, np.newaxis, :]
    return np.asarray((vector * root) @ np.conj(np.swapaxes(vector, 1, 2)))


def _inverse_root(S: Complexes) -> Complexes:
    """Its inverse; the instrument has power on every axis, else there was no estimate to begin with."""
    return np.asarray(np.linalg.inv(_root(S)))
