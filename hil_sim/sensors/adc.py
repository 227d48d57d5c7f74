"""A successive-approximation converter: 12 bits, ratiometric to its reference."""

import numpy as np
from numpy.typing import NDArray

BITS = 12


def convert(volts: NDArray[np.float64], vref_V: float) -> NDArray[np.uint16]:
    """Codes of ideal conversions; voltages beyond the range saturate.

    The code is the nearest whole number, so a code stands for the middle of its step.
    """
    full_scale = 1 << BITS
    code = np.floor(volts * (full_scale / vref_V) + 0.5)
    return np.clip(code, 0, full_scale - 1).astype(np.uint16)
