"""Frequency response matrices from cross-spectra: direct, and derived by way of the commanded perturbation.

Source: [P] eqs. 1, 6 to 9. Both are one estimator, C = S_dw S_Fw^-1, with another instrument w: the measured
force itself (direct) or the commanded perturbation (derived). The perturbation is known and correlates with
neither sensor noise nor voluntary movement, so the derived estimate stays unbiased where the PD hold feeds
the displacement back into the force.
"""

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.arrays import Complexes, Floats


def direct_response(S_yu: Complexes, S_uu: Complexes) -> Complexes:
    """H with y = H u in the least-squares sense, H = S_yu S_uu^-1.

    Args:
        S_yu: cross-spectra, shape (n_f, n_y, n_u).
        S_uu: input spectra, shape (n_f, n_u, n_u).

    Returns:
        H, shape (n_f, n_y, n_u).

    Raises:
        UndeterminedError: the inputs are linearly dependent at some frequency.
    """
    try:
        # H S_uu = S_yu  <=>  S_uu^T H^T = S_yu^T
        transposed = np.linalg.solve(np.swapaxes(S_uu, 1, 2), np.swapaxes(S_yu, 1, 2))
    except np.linalg.LinAlgError as error:
        raise UndeterminedError(
            "the inputs are linearly dependent at some frequency, so their effects cannot be told apart; "
            "excite every axis, with more segments than inputs"
        ) from error
    return np.swapaxes(transposed, 1, 2)


def derived_response(R: Complexes, T: Complexes) -> Complexes:
    """C_der = R T^-1 ([P] eq. 9).

    Args:
        R: from the perturbation to the displacement (m/N), shape (n_f, n, n).
        T: from the perturbation to the force (N/N), shape (n_f, n, n).

    Returns:
        C_der (m/N), shape (n_f, n, n).

    Raises:
        UndeterminedError: T is singular at some frequency.
    """
    return direct_response(R, T)


def impedance(frequency_Hz: Floats, C: Complexes) -> Complexes:
    """Mechanical impedance Z = (j w C)^-1, from velocity to force (N s/m), shape (n_f, n, n).

    C is the dynamic compliance from force to displacement (m/N). [P]'s appendix fits Z rather than C so that
    inertia and stiffness weigh alike. The frequency zero has no impedance: pass positive frequencies only.
    """
    omega = 2 * np.pi * frequency_Hz[:, np.newaxis, np.newaxis]
    return np.asarray(np.linalg.inv(1j * omega * C))


def noise_spectrum(H: Complexes, S_yy: Complexes, S_yu: Complexes, S_uu: Complexes) -> Complexes:
    """Spectrum of y - H u, shape (n_f, n_y, n_y): what the linear model does not explain.

    Holds for any H, not just the least-squares one.
    """
    H_h = np.conj(np.swapaxes(H, 1, 2))
    S_uy = np.conj(np.swapaxes(S_yu, 1, 2))
    return S_yy - H @ S_uy - S_yu @ H_h + H @ S_uu @ H_h
