"""The spectrum of the live view."""

import numpy as np
from numpy.typing import NDArray

SEGMENT = 1024


def amplitude_spectrum(values: list[int]) -> NDArray[np.float64]:
    """Rms over segments of the one-sided amplitude at k * rate / SEGMENT, codes, (SEGMENT/2 + 1,).

    Hann window, mean of each segment removed, no overlap; a sinusoid on a line shows its amplitude.
    """
    count = len(values) // SEGMENT
    segments = np.asarray(values[-count * SEGMENT :], dtype=np.float64).reshape(count, SEGMENT)
    window = np.hanning(SEGMENT + 1)[:-1]
    lines = np.fft.rfft((segments - segments.mean(axis=1, keepdims=True)) * window, axis=1)
    amplitude: NDArray[np.float64] = 2 * np.sqrt(np.mean(np.abs(lines) ** 2, axis=0)) / window.sum()
    return amplitude
