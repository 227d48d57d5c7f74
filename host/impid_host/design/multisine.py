"""Periodic sums of sinusoids: random phases, odd harmonics, low crest factor.

Source: R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, ch. 5 (odd-random
grids, orthogonal multisines); E. van der Ouderaa, J. Schoukens, J. Renneboog, IEEE Trans. Instrum. Meas. 37
(1988) 145-147 (lowering the crest factor by clipping and restoring the amplitudes); P. Guillaume et al., IEEE
Trans. Instrum. Meas. 40 (1991) 982-989 (by minimising norms of rising order).
"""

from dataclasses import dataclass

import numpy as np

from impid_host.impedance.spectral.arrays import Floats

Harmonics = np.ndarray[tuple[int], np.dtype[np.int64]]
SAMPLES_PER_FASTEST_CYCLE = 16
CLIP_LEVEL = 0.9


@dataclass(frozen=True, slots=True)
class Multisine:
    """sum_k a_k cos(2 pi h_k t / period + phi_k).

    Attributes:
        period_s: common period of all components.
        harmonics: h, positive and distinct, shape (k,).
        amplitude: a, in the unit of the signal, shape (k,).
        phase: phi, rad, shape (k,).
    """

    period_s: float
    harmonics: Harmonics
    amplitude: Floats
    phase: Floats

    @property
    def frequency_Hz(self) -> Floats:
        """Of each component, shape (k,)."""
        return np.asarray(self.harmonics / self.period_s)

    def value(self, t: Floats, derivative: int = 0) -> Floats:
        """The signal or its n-th time derivative at times t (s), shape as t."""
        omega = 2 * np.pi * self.frequency_Hz
        angle = np.multiply.outer(t, omega) + self.phase + derivative * np.pi / 2
        return np.asarray(np.cos(angle) @ (self.amplitude * omega**derivative))

    def one_period(self) -> Floats:
        """Samples of one period, fine enough to see the peaks."""
        count = SAMPLES_PER_FASTEST_CYCLE * int(self.harmonics.max())
        return self.value(np.arange(count) * self.period_s / count)

    @property
    def crest_factor(self) -> float:
        """Largest magnitude over rms; sqrt(2) for one sinusoid."""
        return crest_factor(self.one_period())


def crest_factor(x: Floats) -> float:
    """max |x| / rms x."""
    return float(np.max(np.abs(x)) / np.sqrt(np.mean(x**2)))


def odd_random_harmonics(
    rng: np.random.Generator, period_s: float, lower_Hz: float, upper_Hz: float, group: int = 4
) -> Harmonics:
    """Odd harmonics in a band, one at random left out of each group: the gaps show odd distortion.

    The even harmonics stay free as well and show even distortion.

    Args:
        rng: source of the choice.
        period_s: period of the multisine.
        lower_Hz, upper_Hz: band of the excitation.
        group: consecutive odd harmonics of which one is left out.
    """
    odd = np.arange(1, int(np.floor(upper_Hz * period_s + 1e-9)) + 1, 2)
    odd = odd[odd >= lower_Hz * period_s - 1e-9]
    keep = np.ones(len(odd), dtype=bool)
    for start in range(0, len(odd) - group + 1, group):
        keep[start + int(rng.integers(group))] = False
    return np.asarray(odd[keep], dtype=np.int64)


def random_phase_multisine(
    rng: np.random.Generator, period_s: float, harmonics: Harmonics, amplitude: Floats
) -> Multisine:
    """Phases uniform over the circle: with many components the values are nearly normal, as the BLA wants
    them.
    """
    return Multisine(period_s, harmonics, amplitude, rng.uniform(0, 2 * np.pi, len(harmonics)))


def minimise_crest_factor(
    rng: np.random.Generator, period_s: float, harmonics: Harmonics, amplitude: Floats, *, starts: int = 12
) -> Multisine:
    """Choose phases so that the signal stays within the smallest range for its power; takes a second or so.

    Args:
        rng: source of the random starting phases.
        period_s, harmonics, amplitude: as in `Multisine`; they stay as they are.
        starts: starting points of the clipping; the best end point is refined.
    """
    clipped = clip_crest_factor(rng, period_s, harmonics, amplitude, starts=starts)
    phase = _least_norm_phases(harmonics, amplitude, clipped.phase)
    return Multisine(period_s, harmonics, amplitude, phase)


def clip_crest_factor(
    rng: np.random.Generator,
    period_s: float,
    harmonics: Harmonics,
    amplitude: Floats,
    *,
    starts: int = 3,
    iterations: int = 100,
) -> Multisine:
    """The quick part of `minimise_crest_factor`: clip the peaks, restore the amplitudes, repeat."""
    count = SAMPLES_PER_FASTEST_CYCLE * int(harmonics.max())
    best_phase, best_crest = np.zeros(len(harmonics)), np.inf
    for _ in range(starts):
        phase = rng.uniform(0, 2 * np.pi, len(harmonics))
        for iteration in range(iterations):
            spectrum = np.zeros(count // 2 + 1, dtype=np.complex128)
            spectrum[harmonics] = amplitude * np.exp(1j * phase) * count / 2
            x = np.fft.irfft(spectrum, count)
            crest = crest_factor(x)
            if crest < best_crest:
                best_phase, best_crest = phase, crest
            # Clip less and less: large steps first, small ones near the end.
            level = CLIP_LEVEL + (1.0 - CLIP_LEVEL) * iteration / iterations
            limit = level * np.max(np.abs(x))
            phase = np.angle(np.fft.rfft(np.clip(x, -limit, limit))[harmonics])
    return Multisine(period_s, harmonics, amplitude, best_phase)


def _least_norm_phases(harmonics: Harmonics, amplitude: Floats, phase: Floats) -> Floats:
    """Phases that minimise the l_p norm for p = 4, 8, ... 256, each from the last: towards the least
    maximum.
    """
    from scipy.optimize import minimize  # noqa: PLC0415  (a fifth of a second)

    count = SAMPLES_PER_FASTEST_CYCLE * int(harmonics.max())
    angle = 2 * np.pi * np.outer(np.arange(count) / count, harmonics)
    best_phase, best_peak = phase, np.inf

    def signal(phi: Floats) -> Floats:
        return np.asarray(np.cos(angle + phi) @ amplitude)

    for p in 2 ** np.arange(2, 9):
        peak = np.max(np.abs(signal(best_phase)))

        def log_norm(phi: Floats, p: int = int(p), peak: float = float(peak)) -> tuple[float, Floats]:
            x = signal(phi) / peak
            total = np.sum(np.abs(x) ** p)
            slope = -(np.sign(x) * np.abs(x) ** (p - 1)) @ np.sin(angle + phi) * amplitude / (peak * total)
            return float(np.log(total) / p), slope

        result = minimize(log_norm, best_phase, jac=True, method="L-BFGS-B", options={"maxiter": 100})
        found = float(np.max(np.abs(signal(result.x))))
        if found < min(best_peak, peak):
            best_phase, best_peak = np.asarray(result.x), found
    return best_phase


def orthogonal_experiments(inputs: int) -> np.ndarray[tuple[int, int], np.dtype[np.complex128]]:
    """Unitary matrix W, shape (inputs, inputs): input j of experiment e is the multisine times W[j, e]
    sqrt(inputs).

    The discrete Fourier matrix; every input is at full amplitude in every experiment, and the n experiments
    together determine every column of the response.
    """
    index = np.arange(inputs)
    return np.asarray(np.exp(2j * np.pi * np.outer(index, index) / inputs) / np.sqrt(inputs))
