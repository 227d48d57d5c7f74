"""A successive-approximation converter: 12 bits, ratiometric to its reference."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BITS = 12
CONVERSIONS = 8  # of each axis in a tick of the board: IMPID_ADC_PER_TICK


def convert(volts: Array, vref_V: float) -> NDArray[np.uint16]:
    """Codes of ideal conversions; voltages beyond the range saturate.

    The code is the nearest whole number, so a code stands for the middle of its step.
    """
    full_scale = 1 << BITS
    code = np.floor(volts * (full_scale / vref_V) + 0.5)
    return np.clip(code, 0, full_scale - 1).astype(np.uint16)


class AnalogInput:
    """The board's converter on the accelerometer's two outputs."""

    def __init__(self, vref_V: float, noise_lsb: float, generator: np.random.Generator) -> None:
        """noise_lsb: the converter's own, rms, ahead of rounding."""
        self._vref_V = vref_V
        self._noise_V = noise_lsb * (vref_V / (1 << BITS))
        self._generator = generator

    def readings(self, volts: Array, *, self_test: bool) -> NDArray[np.uint16]:  # noqa: ARG002
        """Codes at consecutive conversions: volts (8 n, 2) -> (n, 8, 2). The self-test is in the voltage."""
        noisy = volts + self._noise_V * self._generator.standard_normal(volts.shape)
        return convert(noisy, self._vref_V).reshape(-1, CONVERSIONS, 2)
