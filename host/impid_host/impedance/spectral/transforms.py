"""Windowed transforms of force, motion and instrument of one trial, segment by segment.

Velocity and acceleration are differentiated in time, before the window. The transform of a windowed signal's
derivative is not j w times the transform of the windowed signal: the difference is leakage, and with a window
about as wide as a resonance it moves stiffness and damping by percents. Differentiated first, the equation of
motion F = M d'' + B d' + K d holds exactly in every segment, whatever the window.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.ndimage

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.arrays import Complexes, Floats
from impid_host.impedance.spectral.welch import WelchSetting
from impid_host.signals.density import hann

# Sixth-order central difference: relative error (w h)^6 / 140, 3e-8 at 10 Hz and 500 Hz.
_DIFFERENCE = np.array([1.0, -9.0, 45.0, 0.0, -45.0, 9.0, -1.0]) / 60.0
MARGIN = 2 * (len(_DIFFERENCE) // 2)
Bins = np.ndarray[tuple[int], np.dtype[np.int64]]


@dataclass(frozen=True, slots=True)
class Transforms:
    """One trial; each transform has shape (S, n_f, n), S segments, in units of the signal / sqrt(Hz).

    Attributes:
        F, d, v, a: force (N) and motion (m, m/s, m/s^2).
        p: commanded perturbation (N), or None.
        samples: of the record at `Sampling.reduced`.
        command: the perturbation at that rate (N), shape (samples, n), or None.
        slope: d force / d (parameters known from elsewhere) at that rate, shape (samples, n, k), or None.
    """

    F: Complexes
    d: Complexes
    v: Complexes
    a: Complexes
    p: Complexes | None
    samples: int
    command: Floats | None
    slope: Floats | None

    def at(self, kept: Bins) -> "Transforms":
        """The same at some of the bins only."""
        F, d, v, a = (x[:, kept] for x in (self.F, self.d, self.v, self.a))
        return replace(self, F=F, d=d, v=v, a=a, p=None if self.p is None else self.p[:, kept])

    def of_robot(self) -> "Transforms":
        """The same with what the robot takes of the perturbation, p - F, in place of F.

        Raises:
            ValueError: the perturbation is not known.
        """
        if self.p is None:
            raise ValueError("what the robot takes of an unknown perturbation is unknown")
        return replace(self, F=self.p - self.F)


@dataclass(frozen=True, slots=True)
class Sampling:
    """How records are transformed: rate (Hz), segmentation, and the bins of the zero-padded FFT kept."""

    fs: float
    setting: WelchSetting
    bins: Bins

    @property
    def frequency_Hz(self) -> Floats:
        """Of the kept bins, shape (n_f,)."""
        return np.asarray(self.bins * self.fs / self.setting.n_fft, dtype=np.float64)

    @property
    def reduction(self) -> int:
        """The kept bins lie far below fs / 2; what holds nothing else may be sampled so many times slower."""
        setting = self.setting
        common = math.gcd(setting.n_fft, setting.n_window, setting.n_overlap)
        top = float(self.frequency_Hz[-1])
        return max(q for q in range(1, common + 1) if common % q == 0 and (q == 1 or self.fs / q > 2.4 * top))

    def at(self, kept: Bins) -> "Sampling":
        """The same at some of the bins only."""
        return Sampling(self.fs, self.setting, self.bins[kept])

    def reduced(self) -> "Sampling":
        """The same windows and bins at the slower rate."""
        q, setting = self.reduction, self.setting
        slower = WelchSetting(setting.n_fft // q, setting.n_window // q, setting.n_overlap // q)
        return Sampling(self.fs / q, slower, self.bins)


def transform_trial(
    force: Floats, displacement: Floats, perturbation: Floats | None, slope: Floats | None, sampling: Sampling
) -> Transforms:
    """Transforms of one trial's signals, (N, n) each; the first and last six samples serve the derivatives.

    Raises:
        UndeterminedError: the record is shorter than one window.
    """
    v = _derivative(displacement, sampling.fs)
    a = _derivative(v, sampling.fs)
    inner = slice(MARGIN, len(force) - MARGIN)
    q = sampling.reduction
    slow = slice(MARGIN, len(force) - MARGIN, q)
    return Transforms(
        segment_transforms(force[inner], sampling),
        segment_transforms(displacement[inner], sampling),
        segment_transforms(v[inner], sampling),
        segment_transforms(a[inner], sampling),
        None if perturbation is None else segment_transforms(perturbation[inner], sampling),
        len(force[slow]),
        None if perturbation is None else perturbation[slow],
        None if slope is None else slope[slow],
    )


def _derivative(x: Floats, fs: float) -> Floats:
    return np.asarray(scipy.ndimage.convolve1d(x, _DIFFERENCE * fs, axis=0, mode="nearest"))


def segment_transforms(x: Floats, sampling: Sampling) -> Complexes:
    """Windowed transforms (S, n_f, n) of x (N, n), means removed; 2 E[X X^H] is the one-sided density.

    Raises:
        UndeterminedError: the record is shorter than one window.
    """
    setting = sampling.setting
    if setting.segments(len(x)) < 1:
        raise UndeterminedError(
            f"a record of {len(x)} samples is shorter than one Welch window of {setting.n_window}; "
            "record longer or choose a shorter window"
        )
    window = hann(setting.n_window)
    parts = np.lib.stride_tricks.sliding_window_view(x, setting.n_window, axis=0)[:: setting.step]
    parts = (parts - parts.mean(axis=-1, keepdims=True)) * (window / np.sqrt(sampling.fs * np.sum(window**2)))
    X = np.fft.rfft(parts, setting.n_fft, axis=-1)[..., sampling.bins]
    return np.ascontiguousarray(np.moveaxis(X, 2, 1))


def pooled(a: Sequence[Complexes], b: Sequence[Complexes]) -> Complexes:
    """One-sided cross-spectra S_ab = E[A B^H] over all segments of all trials, shape (n_f, n_a, n_b)."""
    segments = sum(len(part) for part in a)
    total = sum(
        np.transpose(A, (1, 2, 0)) @ np.conj(np.transpose(B, (1, 0, 2))) for A, B in zip(a, b, strict=True)
    )
    return np.asarray(total * (2.0 / segments))


def cross_spectra(a: Floats, b: Floats, fs: float, setting: WelchSetting) -> tuple[Floats, Complexes]:
    """One-sided cross-spectral density matrices S_ab = E[A B^H] of signals (N, n_a) and (N, n_b).

    With this order y = H u gives S_yu = H S_uu, as matrices are written.

    Returns:
        All frequencies (Hz), shape (n_f,), and S_ab (unit a x unit b / Hz), shape (n_f, n_a, n_b).

    Raises:
        UndeterminedError: the record is shorter than one window.
    """
    sampling = Sampling(fs, setting, np.arange(setting.n_fft // 2 + 1))
    S = pooled([segment_transforms(a, sampling)], [segment_transforms(b, sampling)])
    # Frequency zero and, of an even number of samples, the last have no negative counterpart.
    S[[0] if setting.n_fft % 2 else [0, -1]] *= 0.5
    return sampling.frequency_Hz, S


def time_weights(coefficients: Complexes, sampling: Sampling, samples: int) -> Floats:
    """The weights g with sum_t g(t) x(t) = Re sum over s, f of coefficients[q, s, f] X[s, f].

    A sum over windowed transforms is a weighted sum of samples; overlap, window and zero padding are all in
    the weights.

    Args:
        coefficients: shape (q, S, n_f).
        samples: length of the record.

    Returns:
        Shape (q, samples).
    """
    setting = sampling.setting
    window = hann(setting.n_window)
    scale = 1.0 / np.sqrt(sampling.fs * np.sum(window**2))
    spectrum = np.zeros((*coefficients.shape[:2], setting.n_fft // 2 + 1), dtype=np.complex128)
    spectrum[:, :, sampling.bins] = np.conj(coefficients) * (0.5 * setting.n_fft)
    parts = np.fft.irfft(spectrum, setting.n_fft, axis=2)[:, :, : setting.n_window] * (scale * window)
    parts -= parts.mean(axis=2, keepdims=True)
    weights = np.zeros((len(coefficients), samples))
    for s in range(coefficients.shape[1]):
        weights[:, s * setting.step : s * setting.step + setting.n_window] += parts[:, s]
    return weights
