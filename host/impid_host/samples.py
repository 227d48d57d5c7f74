"""What the sensor module measured: one row per sample, raw, on the module's own clock.

`DeviceSamples` is what our board sends. `ForeignSamples` is what another module (an inertial unit, a
data-acquisition card) gave: accelerations in m/s^2 in place of codes, angles or nothing in place of counts.
"""

from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

FLAG_SATURATED = 1 << 0
FLAG_ENCODER_FAULT = 1 << 1
FLAG_LATE = 1 << 2
FLAG_RESET = 1 << 3
FLAG_SYNC_EDGE = 1 << 4

Codes = NDArray[np.unsignedinteger[Any]]


@dataclass(frozen=True, slots=True)
class DeviceSamples:
    """Samples as `device.csv` of the study format names them; every array has shape (N,).

    Attributes:
        t_us: instant of the sample on the module's clock, microseconds since boot; group delay taken off.
        seq: sample number; wraps at 2**32, a gap means lost samples.
        ax, ay: codes of the accelerometer's first two axes: 16 bits, or 24 (uint32) of a sensor with more.
        enc1, enc2: encoder counter values; wrap at 2**31.
        flags: bit 0 ADC saturated, 1 encoder fault, 2 sample late, 3 reset since the last sample,
            4 sync edge.
        az: codes of 24 bits of the third axis; None where the sensor has two.
    """

    t_us: NDArray[np.uint64]
    seq: NDArray[np.uint32]
    ax: Codes
    ay: Codes
    enc1: NDArray[np.int32]
    enc2: NDArray[np.int32]
    flags: NDArray[np.uint8]
    az: NDArray[np.uint32] | None = None

    def __len__(self) -> int:
        return len(self.t_us)


@dataclass(frozen=True, slots=True)
class ForeignSamples:
    """Samples of a module that is not ours; every array has N rows.

    Either `codes` or `acceleration` is there; of `counts` and `theta` one or none. Without either the module
    shares the robot's clock.

    Attributes:
        t_us: instant of the sample on the module's clock, microseconds, shape (N,).
        seq: sample number, shape (N,).
        flags: as in `DeviceSamples`, shape (N,).
        acceleration: specific force along the sensor's axes, m/s^2, shape (N, 2), or None.
        codes: converter codes of the two axes, shape (N, 2), or None.
        theta: joint angles, rad (m), shape (N, n), or None.
        counts: encoder counters, shape (N, 2), or None.
    """

    t_us: NDArray[np.uint64]
    seq: NDArray[np.uint32]
    flags: NDArray[np.uint8]
    acceleration: NDArray[np.float64] | None = None
    codes: NDArray[np.uint16] | None = None
    theta: NDArray[np.float64] | None = None
    counts: NDArray[np.int32] | None = None

    def __len__(self) -> int:
        return len(self.t_us)


ModuleSamples = DeviceSamples | ForeignSamples
Samples = TypeVar("Samples", bound=DeviceSamples | ForeignSamples)


def rows_of(samples: Samples, rows: slice | NDArray[np.bool_]) -> Samples:
    """Some of the rows of either kind."""
    columns = {f.name: getattr(samples, f.name) for f in fields(samples)}
    return replace(samples, **{name: column[rows] for name, column in columns.items() if column is not None})
