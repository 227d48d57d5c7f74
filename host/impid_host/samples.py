"""What the sensor module measured: one row per sample, raw, on the module's own clock."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FLAG_SATURATED = 1 << 0
FLAG_ENCODER_FAULT = 1 << 1
FLAG_LATE = 1 << 2
FLAG_RESET = 1 << 3
FLAG_SYNC_EDGE = 1 << 4


@dataclass(frozen=True, slots=True)
class DeviceSamples:
    """Samples as `device.csv` of the study format names them; every array has shape (N,).

    Attributes:
        t_us: instant of the sample on the module's clock, microseconds since boot; group delay taken off.
        seq: sample number; wraps at 2**32, a gap means lost samples.
        ax, ay: ADC codes of the accelerometer's two axes.
        enc1, enc2: encoder counter values; wrap at 2**31.
        flags: bit 0 ADC saturated, 1 encoder fault, 2 sample late, 3 reset since the last sample,
            4 sync edge.
    """

    t_us: NDArray[np.uint64]
    seq: NDArray[np.uint32]
    ax: NDArray[np.uint16]
    ay: NDArray[np.uint16]
    enc1: NDArray[np.int32]
    enc2: NDArray[np.int32]
    flags: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.t_us)
