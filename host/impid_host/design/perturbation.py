"""Stochastic force perturbations of low mutual coherence.

Source: [P] Sec. II-A: uniformly distributed random numbers through an eighth-order Butterworth filter at 15
Hz, at 500 Hz; the seed is varied until the axes show low coherence.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.impedance.spectral.arrays import Floats
from impid_host.impedance.spectral.transforms import cross_spectra
from impid_host.impedance.spectral.welch import FINE, WelchSetting
from impid_host.signals.recursive import butterworth_sections, recursive

FILTER_ORDER = 8
# The eighth-order filter has forgotten its start after this long (its slowest pole decays in 0.06 s).
WARM_UP_S = 2.0


@dataclass(frozen=True, slots=True)
class Perturbation:
    """Force commands for one trial.

    Attributes:
        force: F_delta (N), shape (N, n).
        fs: sampling rate, Hz.
        seeds: one per axis; `filtered_noise(seed, ...)` gives the axis again.
        mean_coherence: largest mean coherence between two axes over 0 to `cutoff_Hz`.
        chance_coherence: mean over all pairs that were tried: what an unsearched pair has.
        cutoff_Hz: of the filter.
    """

    force: Floats
    fs: float
    seeds: tuple[int, ...]
    mean_coherence: float
    chance_coherence: float
    cutoff_Hz: float

    @property
    def t(self) -> Floats:
        """Time from the start, s, shape (N,)."""
        return np.arange(len(self.force)) / self.fs

    def __str__(self) -> str:
        peak = np.max(np.abs(self.force))
        return (
            f"{len(self.force) / self.fs:g} s at {self.fs:g} Hz, seeds {self.seeds}, peak {peak:.1f} N, "
            f"mean coherence {self.mean_coherence:.3f} (unsearched pairs {self.chance_coherence:.3f})"
        )


def filtered_noise(seed: int, samples: int, fs: float = 500.0, cutoff_Hz: float = 15.0) -> Floats:
    """Uniform random numbers, low-pass filtered, zero mean and unit rms, shape (samples,).

    Args:
        seed: of numpy's PCG64, whose stream is the same on every machine.
        samples: length.
        fs: sampling rate, Hz.
        cutoff_Hz: of the eighth-order Butterworth filter; [P] chose 15 to exceed the arm's 2 to 3 Hz.
    """
    warm_up = round(WARM_UP_S * fs)
    noise = np.random.default_rng(seed).uniform(-1.0, 1.0, (samples + warm_up, 1))
    x = recursive(butterworth_sections(FILTER_ORDER, cutoff_Hz, fs), noise, settled=False)[warm_up:, 0]
    x -= x.mean()
    return np.asarray(x / np.sqrt(np.mean(x**2)))


def pairwise_coherence(signals: Floats, fs: float, upper_Hz: float, setting: WelchSetting) -> Floats:
    """Ordinary coherence of every pair, averaged over 0 to `upper_Hz`.

    Args:
        signals: shape (N, m).

    Returns:
        Shape (m, m), symmetric, ones on the diagonal.
    """
    frequency, cross = cross_spectra(signals, signals, fs, setting)
    cross = cross[(frequency > 0) & (frequency <= upper_Hz)]
    power = np.einsum("faa->fa", cross).real
    coherence = np.abs(cross) ** 2 / (power[:, :, np.newaxis] * power[:, np.newaxis, :])
    return np.asarray(coherence.mean(axis=0))


def design_perturbation(
    rms_N: float,
    *,
    axes: int = 2,
    duration_s: float = 50.0,
    fs: float = 500.0,
    cutoff_Hz: float = 15.0,
    candidates: int = 100,
    first_seed: int = 0,
) -> Perturbation:
    """Search seeds for axes whose perturbations are as unrelated as finite records allow.

    Args:
        rms_N: root mean square of each axis, N.
        axes: how many forces act at once.
        duration_s: of the trial.
        fs: sampling rate, Hz.
        cutoff_Hz: of the filter.
        candidates: seeds tried, from `first_seed` on; all pairs of them are compared.
        first_seed: another value gives another trial.

    Raises:
        ValueError: fewer candidates than axes, or a trial shorter than one Welch window.
    """
    samples = round(duration_s * fs)
    setting = FINE.scaled(fs)
    if candidates < axes:
        raise ValueError(f"{axes} axes need at least {axes} candidate seeds, not {candidates}")
    if samples < setting.n_window:
        window_s = setting.n_window / fs
        raise ValueError(f"a perturbation of {duration_s:g} s is shorter than one window of {window_s:g} s")
    seeds = np.arange(first_seed, first_seed + candidates)
    signals = np.stack([filtered_noise(int(s), samples, fs, cutoff_Hz) for s in seeds], axis=1)
    coherence = pairwise_coherence(signals, fs, cutoff_Hz, setting)
    chosen = _least_coherent(coherence, axes)
    pairs = coherence[np.triu_indices(candidates, 1)]
    among = coherence[np.ix_(chosen, chosen)][np.triu_indices(axes, 1)]
    return Perturbation(
        rms_N * signals[:, chosen],
        fs,
        tuple(int(seeds[c]) for c in chosen),
        float(among.max()) if axes > 1 else 0.0,
        float(pairs.mean()) if candidates > 1 else 0.0,
        cutoff_Hz,
    )


def _least_coherent(coherence: Floats, axes: int) -> list[int]:
    """The best pair, then each time the signal whose worst coherence with the chosen is least."""
    if axes == 1:
        return [0]
    off_diagonal = coherence + np.diag(np.full(len(coherence), np.inf))
    first, second = np.unravel_index(int(np.argmin(off_diagonal)), coherence.shape)
    chosen = [int(first), int(second)]
    while len(chosen) < axes:
        worst = coherence[:, chosen].max(axis=1)
        worst[chosen] = np.inf
        chosen.append(int(np.argmin(worst)))
    return chosen
