"""Power density by Welch's method: Hann windows that overlap by half, each rid of its mean if asked."""

import numpy as np

from impid_host.signals.arrays import Floats


def hann(rows: int) -> Floats:
    """One period of the window, (rows,)."""
    return np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * np.arange(rows) / rows))


def power_density(
    values: Floats, rate_hz: float, window_rows: int, *, rid_of_mean: bool = True
) -> tuple[Floats, Floats]:
    """Frequencies (F,), Hz, and the one-sided density there, unit^2/Hz: (N, ...) -> (F, ...).

    Args:
        window_rows: of each window; at most N.
    """
    step = window_rows - window_rows // 2
    windows = np.lib.stride_tricks.sliding_window_view(values, window_rows, axis=0)[::step]
    if rid_of_mean:
        windows = windows - windows.mean(axis=-1, keepdims=True)
    window = hann(window_rows)
    power = np.mean(np.abs(np.fft.rfft(windows * window, axis=-1)) ** 2, axis=0)
    power /= rate_hz * np.sum(window**2)
    power[..., 1 : (window_rows + 1) // 2] *= 2.0
    frequency: Floats = np.fft.rfftfreq(window_rows, 1 / rate_hz).astype(np.float64)
    return frequency, np.moveaxis(power, -1, 0)
