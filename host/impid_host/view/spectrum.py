"""The spectrum of the live view."""

import numpy as np

from impid_host.signals.arrays import Floats
from impid_host.signals.density import hann

SEGMENT = 4096  # samples: a line every quarter of a hertz at 1 kHz
HIGHEST_HZ = 20.0  # above it neither arm nor excitation has anything to show


def amplitude_spectrum(values: Floats, segment: int = SEGMENT) -> Floats:
    """Rms over half-overlapping segments of the one-sided amplitude at k * rate / segment.

    Hann window, mean of each segment removed; a sinusoid on a line shows its amplitude.

    Args:
        values: (N,) or (N, c), N at least `segment`.

    Returns:
        In the values' unit, (segment / 2 + 1,) or (segment / 2 + 1, c).
    """
    begins = range(len(values) % (segment // 2), len(values) - segment + 1, segment // 2)
    parts = np.stack([np.asarray(values[begin : begin + segment], dtype=np.float64) for begin in begins])
    window = hann(segment).reshape(1, -1, *(1,) * (parts.ndim - 2))
    lines = np.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * window, axis=1)
    amplitude: Floats = 2 * np.sqrt(np.mean(np.abs(lines) ** 2, axis=0)) / window.sum()
    return amplitude
