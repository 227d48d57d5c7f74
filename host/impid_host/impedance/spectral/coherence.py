"""Partial and multiple coherence for any number of inputs and outputs.

Source: J. S. Bendat and A. G. Piersol, Random Data, ch. 7 (conditioned spectra); [P] Sec. II-B and II-E for
the coherences of the derived estimate, which take over the direct estimate's noise spectrum.

Both coherences are ratios of explained to total power, so one pair of functions serves both estimates: with
the least-squares H they reduce to the textbook definitions.
"""

import numpy as np

from impid_host.impedance.spectral.arrays import Complexes, Floats


def conditioned_input_power(S_uu: Complexes) -> Floats:
    """Power of each input after what is linear in all the other inputs was removed, shape (n_f, n_u).

    The Schur complement S_jj - S_jr S_rr^-1 S_rj; for a single input its own power.
    """
    n_u = S_uu.shape[1]
    power = np.empty(S_uu.shape[:2])
    for j in range(n_u):
        rest = [k for k in range(n_u) if k != j]
        power[:, j] = S_uu[:, j, j].real
        if rest:
            S_jr = S_uu[:, [j], :][:, :, rest]
            S_rr = S_uu[:, rest, :][:, :, rest]
            S_rj = np.conj(np.swapaxes(S_jr, 1, 2))
            power[:, j] -= (S_jr @ np.linalg.solve(S_rr, S_rj))[:, 0, 0].real
    return np.clip(power, 0.0, None)


def _explained_share(explained: Floats, noise: Floats) -> Floats:
    """explained / (explained + noise), 0 where both vanish."""
    total = explained + noise
    return np.divide(explained, total, out=np.zeros_like(total), where=total > 0)


def partial_coherence(H: Complexes, S_uu: Complexes, S_noise: Complexes) -> Floats:
    """gamma^2 between output i and input j, both freed of what is linear in the other inputs.

    Args:
        H: frequency response, shape (n_f, n_y, n_u).
        S_uu: input spectra, shape (n_f, n_u, n_u).
        S_noise: spectrum of the direct estimate's residual, shape (n_f, n_y, n_y).

    Returns:
        Values in 0..1, shape (n_f, n_y, n_u).
    """
    explained = np.abs(H) ** 2 * conditioned_input_power(S_uu)[:, np.newaxis, :]
    noise = np.clip(np.diagonal(S_noise, axis1=1, axis2=2).real, 0.0, None)
    return _explained_share(explained, np.broadcast_to(noise[:, :, np.newaxis], explained.shape))


def multiple_coherence(H: Complexes, S_uu: Complexes, S_noise: Complexes) -> Floats:
    """gamma^2 between output i and all inputs together, in 0..1, shape (n_f, n_y). Arguments as above."""
    H_h = np.conj(np.swapaxes(H, 1, 2))
    explained = np.clip(np.diagonal(H @ S_uu @ H_h, axis1=1, axis2=2).real, 0.0, None)
    noise = np.clip(np.diagonal(S_noise, axis1=1, axis2=2).real, 0.0, None)
    return _explained_share(explained, noise)


def zero_coherence_level(averages: float, inputs: int, probability: float = 0.95) -> float:
    """Partial coherence that unrelated signals stay below with that probability.

    With n_d independent averages and q inputs the estimate between unrelated signals has the distribution
    P(gamma^2 < g) = 1 - (1 - g)^(n_d - q) (Bendat & Piersol ch. 9). One when the averages do not suffice.
    """
    degrees = averages - inputs
    return 1.0 if degrees <= 0 else float(1.0 - (1.0 - probability) ** (1.0 / degrees))
