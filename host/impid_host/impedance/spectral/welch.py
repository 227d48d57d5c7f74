"""Auto- and cross-spectra of any number of signals by Welch's method, and how many averages they are worth.

Source: [P] Sec. III-A for the two settings; P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70-73 for
the variance of overlapping segments.
"""

from dataclasses import dataclass

import numpy as np
import scipy.signal

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.arrays import Complexes, Floats


@dataclass(frozen=True, slots=True)
class WelchSetting:
    """How a record is cut into segments: [P]'s N_FFT, N_WND, N_OVL, all in samples, with a Hann window.

    `n_fft` beyond `n_window` pads with zeros: it interpolates the spectrum and adds no resolution.
    """

    n_fft: int
    n_window: int
    n_overlap: int

    def __post_init__(self) -> None:
        if not 0 <= self.n_overlap < self.n_window <= self.n_fft:
            raise ValueError(f"a Welch setting needs 0 <= n_overlap < n_window <= n_fft, not {self}")

    @property
    def step(self) -> int:
        """Samples from the start of one segment to the start of the next."""
        return self.n_window - self.n_overlap

    def segments(self, samples: int) -> int:
        """Whole segments in a record of that many samples ([P]'s N_MNS)."""
        return max(0, (samples - self.n_overlap) // self.step)

    def resolution_Hz(self, fs: float) -> float:
        """Smallest frequency that one window resolves, fs / N_WND ([P]: 0.061 and 0.244 Hz)."""
        return fs / self.n_window

    def scaled(self, fs: float, fs_reference: float = 500.0) -> "WelchSetting":
        """The same durations at another sampling rate, so that resolution and averages stay as published."""
        ratio = fs / fs_reference
        window = round(self.n_window * ratio)
        return WelchSetting(
            max(round(self.n_fft * ratio), window), window, min(round(self.n_overlap * ratio), window - 1)
        )


# [P]'s two settings at 500 Hz: 5 and 45 segments of a 50 s trial.
FINE = WelchSetting(n_fft=8192, n_window=8192, n_overlap=4096)
SMOOTH = WelchSetting(n_fft=8192, n_window=2048, n_overlap=1536)


def cross_spectra(a: Floats, b: Floats, fs: float, setting: WelchSetting) -> tuple[Floats, Complexes]:
    """One-sided cross-spectral density matrices S_ab = E[A B^H].

    With this order y = H u gives S_yu = H S_uu, as matrices are written.

    Args:
        a: signals, shape (N, n_a), any unit.
        b: signals, shape (N, n_b), any unit, same instants as `a`.
        fs: sampling rate, Hz.
        setting: segmentation; each segment has its mean removed.

    Returns:
        Frequencies (Hz), shape (n_f,), and S_ab (unit a x unit b / Hz), shape (n_f, n_a, n_b).

    Raises:
        UndeterminedError: the record is shorter than one segment.
    """
    if setting.segments(len(a)) < 1:
        raise UndeterminedError(
            f"a record of {len(a)} samples is shorter than one Welch window of {setting.n_window}; "
            "record longer or choose a shorter window"
        )
    # scipy's csd is E[conj(X) Y]: its first argument is the one conjugated, here b.
    frequency, spectra = scipy.signal.csd(
        b[:, np.newaxis, :],
        a[:, :, np.newaxis],
        fs=fs,
        window="hann",
        nperseg=setting.n_window,
        noverlap=setting.n_overlap,
        nfft=setting.n_fft,
        detrend="constant",
        axis=0,
    )
    return np.asarray(frequency, dtype=np.float64), np.asarray(spectra, dtype=np.complex128)


def _window_overlap_power(setting: WelchSetting, segments: int, offset: Floats) -> Floats:
    """Sum over segment pairs of the correlation of their estimates, `offset` cycles/sample apart."""
    window = scipy.signal.get_window("hann", setting.n_window)
    power = float(np.sum(window**2))
    total = np.zeros(offset.shape)
    lag = 0
    while lag < segments and lag * setting.step < setting.n_window:
        shift = lag * setting.step
        product = window[: setting.n_window - shift] * window[shift:]
        phase = np.exp(-2j * np.pi * np.outer(offset, np.arange(product.size)))
        correlation = np.abs(phase @ product / power) ** 2
        total += (segments - lag) * correlation * (1.0 if lag == 0 else 2.0)
        lag += 1
    return total


def independent_averages(setting: WelchSetting, samples: int) -> float:
    """How many independent segments the overlapping ones are worth, in terms of variance (Welch 1967).

    [P] counts every segment as independent (5 and 45); 75 % overlap makes 45 segments worth 23.
    """
    segments = setting.segments(samples)
    return segments**2 / float(_window_overlap_power(setting, segments, np.zeros(1))[0])


def bin_correlation(setting: WelchSetting, samples: int, fs: float, spacing_Hz: Floats) -> Floats:
    """Correlation between two averaged cross-spectral estimates that lie `spacing_Hz` apart.

    Window and zero padding make neighbouring frequencies share their noise; a fit over frequencies that took
    them as independent would state intervals too narrow. Holds for spectra flat over one main lobe.

    Returns:
        Correlation in 0..1, same shape as `spacing_Hz`; 1 at zero spacing.
    """
    segments = setting.segments(samples)
    flat = np.abs(np.atleast_1d(spacing_Hz)).ravel() / fs
    distinct, where = np.unique(flat.round(15), return_inverse=True)
    power = _window_overlap_power(setting, segments, np.concatenate([[0.0], distinct]))
    return np.asarray((power[1:] / power[0])[where].reshape(np.shape(spacing_Hz)))
