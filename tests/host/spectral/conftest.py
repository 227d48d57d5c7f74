"""Truth for the spectral tests: linear systems solved exactly by frequency, no code under test."""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.signal

FS = 500.0
ARM = SimpleNamespace(
    # [D] Table V, Method 2, made symmetric: a relaxed arm's size.
    M=np.array([[1.45, 0.66], [0.66, 1.06]]),
    B=np.array([[10.9, 2.9], [2.9, 6.0]]),
    K=np.array([[172.0, 31.0], [31.0, 112.0]]),
)


def dynamic_stiffness(omega, M, B, K):
    """K + jwB - w^2 M, shape (n_w, n, n)."""
    w = omega[:, np.newaxis, np.newaxis]
    return K + 1j * w * B - w**2 * M


def respond(transfer, u, fs=FS):
    """The exact response of a decaying system to u, shape (N, n): 60 s of zeros keep the ends apart."""
    n_fft = 2 ** int(np.ceil(np.log2(len(u) + 60 * fs)))
    omega = 2 * np.pi * np.fft.rfftfreq(n_fft, 1 / fs)
    spectrum = np.einsum("fij,fj->fi", transfer(omega), np.fft.rfft(u, n_fft, axis=0))
    return np.fft.irfft(spectrum, n_fft, axis=0)[: len(u)]


def coloured(rng, samples, axes, cutoff_Hz=15.0, rms=3.0, fs=FS):
    """Independent Gaussian noise below a cutoff, shape (samples, axes)."""
    sos = scipy.signal.butter(4, cutoff_Hz, fs=fs, output="sos")
    x = scipy.signal.sosfilt(sos, rng.standard_normal((samples + 500, axes)), axis=0)[500:]
    return rms * x / x.std(axis=0)


def segment_spectra(x, setting):
    """Windowed segment transforms by numpy alone, shape (segments, n_f, n)."""
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(setting.n_window) / setting.n_window)
    starts = range(0, len(x) - setting.n_window + 1, setting.n_window - setting.n_overlap)
    return np.stack(
        [
            np.fft.rfft(
                window[:, np.newaxis]
                * (x[s : s + setting.n_window] - x[s : s + setting.n_window].mean(axis=0)),
                setting.n_fft,
                axis=0,
            )
            for s in starts
        ]
    )


@pytest.fixture(scope="session")
def truth():
    """The functions and the arm above, as one name."""
    return SimpleNamespace(
        FS=FS,
        arm=ARM,
        dynamic_stiffness=dynamic_stiffness,
        respond=respond,
        coloured=coloured,
        segment_spectra=segment_spectra,
    )
