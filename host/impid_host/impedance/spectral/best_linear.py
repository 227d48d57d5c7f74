"""Best linear approximation from periodic multisines, with noise and nonlinear distortion told apart.

Source: R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, ch. 4 and 7 (robust
method). Periods of one realisation repeat everything but noise; realisations with other random phases repeat
only what is linear. The scatter over periods is noise, what the scatter over realisations has beyond it is
the stochastic nonlinear distortion.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.arrays import Complexes, Floats

NONLINEAR_P_VALUE = 0.01


@dataclass(frozen=True, slots=True)
class BestLinearApproximation:
    """G from n_u inputs to n_y outputs at the excited frequencies, in output over input unit.

    Attributes:
        frequency_Hz: shape (n_f,).
        G: shape (n_f, n_y, n_u).
        noise_sd: standard deviation of G (complex magnitude) by noise alone, same shape.
        total_sd: standard deviation of G by noise and nonlinear distortion, same shape.
        distortion_sd: scatter of one realisation by nonlinear distortion, same shape; zero where noise hides
            it.
        p_value: that scatter this large between realisations comes from noise alone.
        realisations, periods: what it was estimated from.
    """

    frequency_Hz: Floats
    G: Complexes
    noise_sd: Floats
    total_sd: Floats
    distortion_sd: Floats
    p_value: float
    realisations: int
    periods: int

    @property
    def verdict(self) -> str:
        """One sentence for the lab book."""
        size = float(np.sqrt(np.mean(np.abs(self.G) ** 2)))
        distortion = 100 * float(np.sqrt(np.mean(self.distortion_sd**2))) / size
        noise = 100 * float(np.sqrt(np.mean(self.noise_sd**2))) / size
        if self.p_value >= NONLINEAR_P_VALUE:
            return f"linear as far as the noise lets see ({noise:.2g} % of the response)"
        return (
            f"nonlinear distortion of {distortion:.2g} % of the response per realisation, noise "
            f"leaves {noise:.2g} % on the mean (p = {self.p_value:.2g}); a linear model holds at this "
            "amplitude only"
        )

    def __str__(self) -> str:
        return f"best linear approximation at {len(self.frequency_Hz)} lines: {self.verdict}"


def best_linear_approximation(
    u: Floats,
    y: Floats,
    fs: float,
    harmonics: np.ndarray[tuple[int], np.dtype[np.int64]],
    reference: Floats | None = None,
) -> BestLinearApproximation:
    """Robust method: M realisations, each with n_u orthogonal experiments of P steady periods.

    Args:
        u: inputs, shape (M, n_u, P, N, n_u): realisation, experiment, period, sample, channel.
        y: outputs, shape (M, n_u, P, N, n_y), transients gone.
        fs: sampling rate, Hz; N / fs is the period of the multisine.
        harmonics: excited ones, shape (n_f,).
        reference: the exactly known multisine, shape (M, n_u, N, n_u), where the inputs are measured with
            noise or within a loop: then G = G_ry G_ru^-1, free of both noises, as [P]'s derived estimate is.

    Raises:
        UndeterminedError: fewer than two periods or two realisations, so that noise, or distortion, has no
            scatter.
    """
    M, experiments, P, N, n_u = u.shape
    if P < 2 or M < 2:
        raise UndeterminedError(
            f"{M} realisations of {P} periods: telling noise from distortion needs at least two of each"
        )
    if experiments != n_u:
        raise UndeterminedError(f"{n_u} inputs need {n_u} experiments in each realisation, not {experiments}")
    U, Y = (_lines(x, harmonics) for x in (u, y))
    U_mean, Y_mean = U.mean(axis=1), Y.mean(axis=1)
    R_inverse = np.linalg.inv(
        U_mean if reference is None else _lines(reference[:, :, np.newaxis], harmonics)[:, 0]
    )

    G_ru, G_ry = U_mean @ R_inverse, Y_mean @ R_inverse
    G_ru_inverse = np.linalg.inv(G_ru.mean(axis=0))
    G = G_ry.mean(axis=0) @ G_ru_inverse

    between = (G_ry - G @ G_ru) @ G_ru_inverse
    total_variance = np.sum(np.abs(between) ** 2, axis=0) / (M - 1) / M
    deviation = (Y - Y_mean[:, np.newaxis]) - G @ (U - U_mean[:, np.newaxis])
    within = deviation @ R_inverse[:, np.newaxis] @ G_ru_inverse
    noise_variance = np.sum(np.abs(within) ** 2, axis=(0, 1)) / (P - 1) / P / M**2
    excess = np.clip(total_variance - noise_variance, 0.0, None)
    return BestLinearApproximation(
        np.asarray(harmonics * fs / N),
        G,
        np.sqrt(noise_variance),
        np.sqrt(total_variance),
        np.sqrt(M * excess),
        _excess_p_value(total_variance, noise_variance, M, P),
        M,
        P,
    )


def _lines(x: Floats, harmonics: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Complexes:
    """(M, E, P, N, n) in time -> (M, P, n_f, n, E) at the excited lines: experiments become columns."""
    spectrum = np.fft.rfft(x, axis=3)[:, :, :, harmonics] * (2.0 / x.shape[3])
    return np.moveaxis(spectrum, 1, -1)


def _excess_p_value(total: Floats, noise: Floats, M: int, P: int) -> float:
    """Probability of this mean ratio of total to noise variance when there is no distortion.

    Each of the n_f n_y ratios has 2 (M - 1) over 2 M (P - 1) degrees of freedom for one input; elements in
    one row share their output's noise and are counted once.
    """
    n_f, n_y, _ = total.shape
    ratio = float(np.sum(total) / np.sum(noise)) if np.sum(noise) > 0 else np.inf
    effective = effective_count(noise)
    return float(special.fdtrc(2 * (M - 1) * effective, 2 * M * (P - 1) * min(effective, n_f * n_y), ratio))


def effective_count(variance: Floats) -> float:
    """How many equally strong variances a sum of unequal ones is worth, (sum v)^2 / sum v^2, at least one."""
    total = float(np.sum(variance**2))
    return max(1.0, float(np.sum(variance)) ** 2 / total) if total > 0 else 1.0
