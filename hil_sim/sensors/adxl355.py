"""The ADXL355's digital part: filter, range and width, read once a tick of the board.

Source: Analog Devices, ADXL354/ADXL355 data sheet: +-2.048 g over 20 bits, 256000 codes a g; at an output
rate of 1000 Hz a filter of 250 Hz that delays by 1.78 periods; ahead of it an analog low-pass of 1500 Hz;
22.5 ug/rtHz.

Three running means of a millisecond stand for the filter: -3 dB at 262 Hz, 1312.5 us. With the analog
low-pass (106.1 us) that leaves 361.4 us of the 1780 us, which the sensor reads later than it happened. The
board raises SYNC 220 us before its tick, so that a reading is 2000 us old when the tick takes it.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, lfilter_zi

from hil_sim.sensors.adc import CONVERSIONS

Array = NDArray[np.float64]
PART = "ADXL355"
BITS = 20
CODES_PER_G = 256_000.0
FULL_SCALE_G = (1 << BITS) / CODES_PER_G
ANALOG_Hz = 1500.0
NOISE_UG_PER_RTHZ = 22.5
SELF_TEST_G = (0.3, 0.3, 1.5)
_RATE_Hz = 8000.0
_MEAN = np.ones(CONVERSIONS) / CONVERSIONS
_TAPS = np.convolve(np.convolve(_MEAN, _MEAN), _MEAN)
# Beyond what analog low-pass and running means delay by themselves, up to the tick.
LATE_S = 2000e-6 - (len(_TAPS) - 1) / 2 / _RATE_Hz - 1.0 / (2.0 * np.pi * ANALOG_Hz)


class DigitalOutput:
    """From what the two axes in the plane feel to the readings of all three."""

    def __init__(self, upright_g: float, noise_ug_per_rtHz: float, generator: np.random.Generator) -> None:
        """upright_g: what the third axis, across the plane, feels at rest; the noise is that axis' own."""
        self._upright_g = upright_g
        self._noise_g = 1e-6 * noise_ug_per_rtHz * np.sqrt(0.5 * _RATE_Hz)
        self._generator = generator
        self._state: Array | None = None

    def readings(self, shifted_g: Array, *, self_test: bool) -> NDArray[np.uint32]:
        """Codes of 20 bits, one a tick.

        Args:
            shifted_g: of the axes in the plane at 8 kHz, self-test included, mid-scale at half of the range,
                shape (8 n, 2), g.
            self_test: it is switched on: the third axis answers too.

        Returns:
            Shape (n, 1, 3).
        """
        upright = self._upright_g + (SELF_TEST_G[2] if self_test else 0.0)
        noise = self._noise_g * self._generator.standard_normal(shifted_g.shape[0])
        felt = np.column_stack([shifted_g, 0.5 * FULL_SCALE_G + upright + noise])
        if self._state is None:
            self._state = lfilter_zi(_TAPS, [1.0])[:, None] * felt[:1]
        filtered, self._state = lfilter(_TAPS, [1.0], felt, axis=0, zi=self._state)
        codes = np.floor(filtered[CONVERSIONS - 1 :: CONVERSIONS] * CODES_PER_G + 0.5)
        return np.asarray(np.clip(codes, 0, (1 << BITS) - 1), dtype=np.uint32)[:, None, :]
