"""Two signals slid along each other: sums of products over their overlap at every lag."""

import numpy as np

from impid_host.signals.arrays import Floats


def correlation(fast: Floats, slow: Floats) -> Floats:
    """Sum over rows and columns of fast times slow where they overlap: (N, k), (M, k) -> (N + M - 1,).

    At place p row 0 of `slow` lies on row p - (M - 1) of `fast`.
    """
    size = len(fast) + len(slow) - 1
    length = _quick_length(size)
    product = np.fft.rfft(fast, length, axis=0) * np.fft.rfft(slow[::-1], length, axis=0)
    return np.fft.irfft(product.sum(axis=1), length)[:size]


def overlap_sums(values: Floats, other_rows: int) -> Floats:
    """Sum of `values` (N,) over what a signal of `other_rows` (M) covers of it at each place, (N + M - 1,).

    Of the signal that slides, it is that of its reverse over the rows of the other.
    """
    total = np.concatenate([[0.0], np.cumsum(values)])
    place = np.arange(len(values) + other_rows - 1)
    sums: Floats = total[np.minimum(place + 1, len(values))] - total[np.maximum(place + 1 - other_rows, 0)]
    return sums


def _quick_length(size: int) -> int:
    """The next product of a power of two and 1, 3, 5, 9 or 15, whose transform is quick."""
    return min(odd << max(0, int(np.ceil(np.log2(size / odd)))) for odd in (1, 3, 5, 9, 15))
