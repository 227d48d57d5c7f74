"""Periodic force perturbations from which the best linear approximation tells noise from nonlinearity.

Source: R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, ch. 3 and 5:
orthogonal random-phase multisines on an odd-random grid.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.design.multisine import Harmonics, odd_random_harmonics, orthogonal_experiments
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.arrays import Floats


@dataclass(frozen=True, slots=True)
class ForceMultisines:
    """A set of experiments.

    Attributes:
        force: one period of every experiment (N), shape (M, n, N, n): realisation, experiment, sample, axis.
        harmonics: excited ones, all odd, shape (n_f,).
        fs: sampling rate, Hz.
        lead_in: periods to run before recording, until transients are gone.
        periods: steady periods to record.
    """

    force: Floats
    harmonics: Harmonics
    fs: float
    lead_in: int
    periods: int

    def command(self, realisation: int, experiment: int) -> Floats:
        """What the robot is to play (N), lead-in and steady periods, shape ((lead_in + periods) N, n)."""
        return np.tile(self.force[realisation, experiment], (self.lead_in + self.periods, 1))

    def __str__(self) -> str:
        M, n, N, _ = self.force.shape
        seconds = M * n * (self.lead_in + self.periods) * N / self.fs
        highest = self.harmonics.max() * self.fs / N
        return (
            f"{M} realisations of {n} experiments, {len(self.harmonics)} lines up to {highest:g} Hz, "
            f"{seconds:g} s in all, peak {np.max(np.abs(self.force)):.1f} N"
        )


def design_force_multisines(
    rms_N: float,
    *,
    axes: int = 2,
    realisations: int = 4,
    period_s: float = 10.0,
    lower_Hz: float = 0.1,
    upper_Hz: float = 15.0,
    fs: float = 500.0,
    lead_in: int = 1,
    periods: int = 4,
    seed: int = 0,
) -> ForceMultisines:
    """Odd-random multisines of equal amplitudes, orthogonal between axes over the n experiments.

    Args:
        rms_N: of every axis in every experiment, N.
        axes: n.
        realisations: M, with new random phases each; the lines stay.
        period_s: a whole number of samples at `fs`.
        lower_Hz, upper_Hz: band of the excitation.
        fs: sampling rate, Hz.
        lead_in, periods: periods before, and of, the recording.
        seed: of the random choices.

    Raises:
        UndeterminedError: the band holds no odd line, or the period is no whole number of samples.
    """
    samples = round(period_s * fs)
    if abs(samples - period_s * fs) > 1e-6:
        raise UndeterminedError(
            f"a period of {period_s:g} s is no whole number of samples at {fs:g} Hz; change one"
        )
    rng = np.random.default_rng(seed)
    harmonics = odd_random_harmonics(rng, period_s, lower_Hz, upper_Hz)
    if len(harmonics) < 2:
        raise UndeterminedError(
            f"fewer than two odd lines between {lower_Hz:g} and {upper_Hz:g} Hz; lengthen the period"
        )
    W = orthogonal_experiments(axes) * np.sqrt(axes)
    amplitude = rms_N * np.sqrt(2.0 / len(harmonics))
    phase = rng.uniform(0, 2 * np.pi, (realisations, axes, len(harmonics)))
    spectrum = np.zeros((realisations, axes, samples // 2 + 1, axes), dtype=np.complex128)
    # axis j of experiment e turns all phases of its multisine by that of W[j, e]
    lines = amplitude * np.exp(1j * phase)
    spectrum[:, :, harmonics, :] = np.einsum("mjk,je->mekj", lines, W) * samples / 2
    return ForceMultisines(np.fft.irfft(spectrum, samples, axis=2), harmonics, fs, lead_in, periods)
