"""How well a modelled impedance accounts for an estimated one: the VAF matrix and R^2.

Source: [P] appendix, eqs. A.3 to A.6. psi_z is the weighted squared difference of gain and phase, psi_n the
weighted square of the model's own gain and phase.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.arrays import Complexes, Floats
from impid_host.impedance.spectral.second_order import (
    GAIN_WEIGHT,
    gain_and_phase,
    negligible_gain,
    weighted_differences,
)


@dataclass(frozen=True, slots=True)
class Agreement:
    """VAF of each element (%), shape (n, n), and R^2 of them all, over frequencies up to `upper_Hz`.

    An element of VAF is NaN where the model's element vanishes: [P] finds the off-diagonal ones of isotropic
    loads "numerically ill-conditioned".
    """

    vaf_percent: Floats
    r_squared: float
    upper_Hz: float

    def __str__(self) -> str:
        rows = "; ".join(" ".join(f"{v:6.2f}" for v in row) for row in self.vaf_percent)
        return f"0 to {self.upper_Hz:g} Hz: VAF [{rows}] %, R² {self.r_squared:.4f}"


def agreement(
    frequency_Hz: Floats, Z_e: Complexes, Z_m: Complexes, gamma2: Floats, upper_Hz: float
) -> Agreement:
    """VAF matrix and R^2 of a model against an estimate.

    Args:
        frequency_Hz: positive frequencies, shape (n_f,).
        Z_e: estimated impedance (N s/m), shape (n_f, n, n).
        Z_m: modelled impedance (N s/m), same shape.
        gamma2: partial coherence of the estimate, same shape.
        upper_Hz: highest frequency counted; [P] uses 5 and 10 Hz.

    Raises:
        UndeterminedError: no frequency lies in the band.
    """
    band = frequency_Hz <= upper_Hz
    if not np.any(band):
        raise UndeterminedError(
            f"no frequency between the resolution and {upper_Hz:g} Hz; use a longer window"
        )
    Z_e, Z_m, gamma2 = Z_e[band], Z_m[band], gamma2[band]
    gain_difference, phase_difference = weighted_differences(Z_e, Z_m, gamma2)
    psi_z = np.sum(gain_difference**2 + phase_difference**2, axis=0)
    gain, phase = gain_and_phase(Z_m, negligible_gain(Z_m))
    psi_n = np.sum((GAIN_WEIGHT * gamma2 * gain) ** 2 + (gamma2 * phase) ** 2, axis=0)
    vanishing = np.max(np.abs(Z_m), axis=0) <= negligible_gain(Z_m)
    ratio = np.divide(psi_z, psi_n, out=np.full_like(psi_z, np.nan), where=(psi_n > 0) & ~vanishing)
    counted = ~vanishing
    return Agreement(
        100.0 * (1.0 - ratio), float(1.0 - psi_z[counted].sum() / psi_n[counted].sum()), float(upper_Hz)
    )
