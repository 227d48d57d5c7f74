"""The second-order model (M, B, K) behind a measured impedance.

Source: [P] appendix, eqs. A.1 and A.2: nonlinear least squares on the differences in gain (dB, times ten) and
phase (deg), each weighted by the partial coherence. Where the paper says "partial coherence function" it
means gamma^2, as everywhere else in it.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.arrays import Complexes, Floats

GAIN_WEIGHT = 10.0
NORMAL_95 = 1.959964
DB_PER_NEPER = 20.0 / np.log(10.0)
DEG_PER_RAD = 180.0 / np.pi
# Elements this far below the largest one are zero to rounding and carry neither gain nor phase.
NEGLIGIBLE_GAIN = 1e-12


@dataclass(frozen=True, slots=True)
class SecondOrderFit:
    """M (kg), B (N s/m), K (N/m), each (n, n), with standard deviations of the same shape and unit.

    Attributes:
        covariance: of the vector (M, B, K), each matrix row by row, shape (3 n^2, 3 n^2); None where it was
            not estimated, and the standard deviations are then NaN.
        cost: psi_z of [P] eq. A.1 at the solution, summed over the elements.
        band_Hz: lowest and highest frequency that entered.
        bias: of M, B, K by the method, as far as known, shape (3, n, n). The values are as the method gives
            them; the intervals are about the values less their bias.
    """

    M: Floats
    B: Floats
    K: Floats
    M_sd: Floats
    B_sd: Floats
    K_sd: Floats
    covariance: Floats | None
    cost: float
    band_Hz: tuple[float, float]
    bias: Floats

    def ci95(self, name: str) -> Floats:
        """95 % interval of each entry of the matrix M, B or K, shape (n, n, 2)."""
        centre = getattr(self, name) - self.bias["MBK".index(name)]
        half = NORMAL_95 * getattr(self, f"{name}_sd")
        return np.stack([centre - half, centre + half], axis=-1)

    def impedance(self, frequency_Hz: Floats) -> Complexes:
        """Z = j w M + B + K / (j w), N s/m, shape (n_f, n, n)."""
        return second_order_impedance(frequency_Hz, self.M, self.B, self.K)

    def __str__(self) -> str:
        lines = [
            f"second-order fit, {self.band_Hz[0]:.2f} to {self.band_Hz[1]:.2f} Hz (value [95 % interval])"
        ]
        for name, unit in (("M", "kg"), ("B", "N s/m"), ("K", "N/m")):
            interval = self.ci95(name)
            for i, row in enumerate(getattr(self, name)):
                cells = "  ".join(
                    f"{v:10.4g} [{low:.4g}, {high:.4g}]"
                    for v, (low, high) in zip(row, interval[i], strict=True)
                )
                lines.append(f"  {name if i == 0 else ' '} {cells} {unit if i == 0 else ''}".rstrip())
        return "\n".join(lines)


def second_order_impedance(frequency_Hz: Floats, M: Floats, B: Floats, K: Floats) -> Complexes:
    """Z = j w M + B + K / (j w) from velocity (m/s) to force (N), shape (n_f, n, n); w must be positive."""
    jw = 2j * np.pi * frequency_Hz[:, np.newaxis, np.newaxis]
    return np.asarray(jw * M + B + K / jw)


def gain_and_phase(Z: Complexes, floor: float) -> tuple[Floats, Floats]:
    """Gain in dB (never below `floor`, an absolute gain) and phase in degrees, both shaped like Z."""
    return 20.0 * np.log10(np.maximum(np.abs(Z), floor)), np.angle(Z, deg=True)


def weighted_differences(Z_e: Complexes, Z_m: Complexes, gamma2: Floats) -> tuple[Floats, Floats]:
    """[P] eq. A.2: 10 gamma^2 times the gain difference (dB), gamma^2 times the phase difference (deg).

    The phase difference is taken the short way round the circle: -179 and +179 deg lie 2 deg apart.

    Args:
        Z_e: estimated impedance, shape (n_f, n, n).
        Z_m: modelled impedance, same shape.
        gamma2: partial coherence of the estimate, same shape.
    """
    floor = negligible_gain(Z_e)
    gain_e, _ = gain_and_phase(Z_e, floor)
    gain_m, _ = gain_and_phase(Z_m, floor)
    phase = np.angle(Z_e * np.conj(Z_m), deg=True)
    return GAIN_WEIGHT * gamma2 * (gain_e - gain_m), gamma2 * phase


def negligible_gain(Z: Complexes) -> float:
    """The absolute gain below which an element of Z is rounding noise."""
    return NEGLIGIBLE_GAIN * float(np.max(np.abs(Z)))


def fit_second_order(frequency_Hz: Floats, Z: Complexes, gamma2: Floats) -> SecondOrderFit:
    """Fit M, B and K, each a full n x n matrix, to an impedance estimate; `surrogates` gives the intervals.

    Args:
        frequency_Hz: positive frequencies, shape (n_f,).
        Z: impedance estimate (N s/m), shape (n_f, n, n); n = 1 for a single joint.
        gamma2: partial coherence of each element, shape (n_f, n, n).

    Raises:
        UndeterminedError: fewer frequencies with coherent data than the model has unknowns.
    """
    n = Z.shape[1]
    usable = (gamma2 > 0) & (np.abs(Z) > negligible_gain(Z))
    if np.min(np.sum(np.any(usable, axis=2), axis=0)) < 3:
        raise UndeterminedError(
            "fewer than three frequencies with coherent data: M, B and K cannot be told apart; "
            "widen the band, record longer or shake harder"
        )
    weight = np.where(usable, gamma2, 0.0)
    parameters = np.zeros((3, n, n))
    # Each element of Z depends on its own three parameters only, so the one problem falls apart into n^2.
    for i in range(n):
        for j in range(n):
            parameters[:, i, j] = _fit_element(frequency_Hz, Z[:, i, j], weight[:, i, j], negligible_gain(Z))
    unknown = np.full((n, n), np.nan)
    gain, phase = weighted_differences(Z, second_order_impedance(frequency_Hz, *parameters), weight)
    cost = float(np.sum(gain**2) + np.sum(phase**2))
    band = (float(frequency_Hz[0]), float(frequency_Hz[-1]))
    M, B, K = parameters
    return SecondOrderFit(M, B, K, unknown, unknown, unknown, None, cost, band, np.zeros((3, n, n)))


def _fit_element(frequency_Hz: Floats, z: Complexes, weight: Floats, floor: float) -> Floats:
    """One element's (m, b, k), shape (3,).

    Args:
        frequency_Hz: shape (n_f,).
        z: the element (N s/m), shape (n_f,).
        weight: shape (n_f,).
        floor: gain (N s/m) that counts as zero.
    """
    n_f = len(frequency_Hz)
    jw = 2j * np.pi * frequency_Hz
    basis = np.stack([jw, np.ones(n_f), 1 / jw], axis=1)
    if not np.any(weight > 0):
        return np.zeros(3)
    from scipy.optimize import least_squares  # noqa: PLC0415  (a fifth of a second)

    z_safe = np.where(np.abs(z) > floor, z, floor)

    def residual(parameters: Floats) -> Floats:
        model = basis @ parameters
        gain = DB_PER_NEPER * np.log(np.abs(z_safe) / np.maximum(np.abs(model), floor))
        phase = np.angle(z_safe * np.conj(model), deg=True)
        return np.concatenate([GAIN_WEIGHT * weight * gain, weight * phase])

    def jacobian(parameters: Floats) -> Floats:
        model = basis @ parameters
        slope = weight[:, np.newaxis] * basis / np.where(np.abs(model) > floor, model, np.inf)[:, np.newaxis]
        return np.concatenate([-GAIN_WEIGHT * DB_PER_NEPER * slope.real, -DEG_PER_RAD * slope.imag])

    omega = 2 * np.pi * float(np.sqrt(frequency_Hz[0] * frequency_Hz[-1]))
    size = float(np.median(np.abs(z_safe)))
    solution = least_squares(
        residual,
        _linear_start(basis, z_safe, weight),
        jac=jacobian,
        x_scale=[size / omega, size, size * omega],
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
    )
    return np.asarray(solution.x)


def _linear_start(basis: Complexes, z: Complexes, weight: Floats) -> Floats:
    """Least squares on z relative to its size: linear in the parameters, so it needs no start of its own."""
    w = (weight / np.abs(z))[:, np.newaxis]
    rows = np.concatenate([(w * basis).real, (w * basis).imag])
    target = np.concatenate([(w[:, 0] * z).real, (w[:, 0] * z).imag])
    return np.asarray(np.linalg.lstsq(rows, target, rcond=None)[0], dtype=np.float64)
