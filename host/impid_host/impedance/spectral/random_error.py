"""Normalised random error of a frequency response estimate.

Source: [P] Sec. III-A, whose print lost the squares; Bendat & Piersol, Random Data, ch. 9. In full:

    e = sqrt((1 - gamma^2) / (2 (N - 1) gamma^2))        two inputs, gamma^2 the partial coherence

Conditioning on q - 1 other inputs costs q - 1 averages, hence N - q + 1 for any number of inputs.
"""

import numpy as np

from impid_host.impedance.spectral.arrays import Floats


def random_error(gamma2: Floats, averages: float, inputs: int) -> Floats:
    """Standard deviation of |H_ij| over |H_ij|, and to first order of its phase in rad.

    Args:
        gamma2: partial coherence, any shape.
        averages: number of averages N; `independent_averages` accounts for overlap, [P] counts all segments.
        inputs: number of inputs q.

    Returns:
        Same shape as `gamma2`; infinite where the coherence is zero or N < q.
    """
    degrees = averages - inputs + 1
    if degrees <= 0:
        return np.full(np.shape(gamma2), np.inf)
    with np.errstate(divide="ignore"):
        return np.asarray(np.sqrt((1.0 - gamma2) / (2.0 * degrees * gamma2)))
