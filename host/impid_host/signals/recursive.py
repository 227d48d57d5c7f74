"""Recursive filters of first and second order, and what is built of them, by LAPACK.

`y[k] = b0 x[k] + b1 x[k-1] + b2 x[k-2] - a1 y[k-1] - a2 y[k-2]` is a triangular system with three diagonals,
and its forward substitution is the filter. `scipy.signal` does it in half the time, but importing that takes
ten times as long as filtering a trial.
"""

import numpy as np

from impid_host.signals.arrays import Floats


def recursive(sections: Floats, values: Floats, *, settled: bool) -> Floats:
    """Sections (k, 6), b0, b1, b2, 1, a1, a2, one after the other along axis 0: (N, c) -> (N, c).

    Each column of the result is in one piece.

    Args:
        settled: start as if the first value had been there for ever; else as if zero had.
    """
    if values.size == 0:  # LAPACK would not be content with no columns
        return np.zeros(values.shape)
    for section in sections:
        values = _section(section, values, settled)
    return values


def _section(section: Floats, values: Floats, settled: bool) -> Floats:
    from scipy.linalg import lapack  # noqa: PLC0415  (a tenth of a second, which starting can do without)

    b, a = section[:3], section[3:]
    driven = np.empty(values.shape, order="F")
    np.multiply(values, b[0], out=driven)
    for delay in (1, 2):
        if b[delay]:
            driven[delay:] += b[delay] * values[: max(len(values) - delay, 0)]
    if settled:
        given, rested = values[0], b.sum() / a.sum() * values[0]
        driven[:1] += (b[1] + b[2]) * given - (a[1] + a[2]) * rested
        driven[1:2] += b[2] * given - a[2] * rested
    order = 2 if a[2] else 1
    diagonals = np.empty((order + 1, len(values)), order="F")
    diagonals[:] = a[: order + 1, None]
    solved: Floats
    solved, _ = lapack.dtbtrs(diagonals, driven, uplo="L", diag="U", overwrite_b=1)
    return solved


def butterworth_sections(order: int, cutoff_hz: float, rate_hz: float) -> Floats:
    """A Butterworth low-pass as sections (k, 6), each of gain one at rest, whose -3 dB frequency stays.

    The analogue filter's poles lie on a half circle; sections follow from the real axis outwards, the slowest
    to settle last.

    Raises:
        ValueError: a cut-off that is not between zero and half the rate.
    """
    if not 0.0 < cutoff_hz < 0.5 * rate_hz:
        raise ValueError(f"no low-pass at {cutoff_hz:g} Hz for signals at {rate_hz:g} Hz")
    corner = float(np.tan(np.pi * cutoff_hz / rate_hz))
    angles = np.pi / (2 * order) * np.arange(1 - order % 2, order, 2)
    return np.array([first_order(corner) if a == 0 else second_order(corner, np.cos(a)) for a in angles])


def first_order(corner: float) -> Floats:
    """1 / (1 + s / w) by the bilinear transform, as a section (6,): b0, b1, b2, 1, a1, a2.

    Args:
        corner: w divided by twice the sampling rate.
    """
    gain = corner / (1.0 + corner)
    return np.array([gain, gain, 0.0, 1.0, (corner - 1.0) / (corner + 1.0), 0.0])


def second_order(corner: float, damping: float) -> Floats:
    """1 / (1 + 2 damping s / w + (s / w)^2), likewise."""
    size = 1.0 + 2.0 * damping * corner + corner**2
    gain = corner**2 / size
    return np.array(
        [
            gain,
            2.0 * gain,
            gain,
            1.0,
            2.0 * (corner**2 - 1.0) / size,
            (1.0 - 2.0 * damping * corner + corner**2) / size,
        ]
    )
