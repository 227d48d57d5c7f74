"""What the native board and the emulated one are both fed with."""

import numpy as np
from numpy.typing import NDArray

MARGIN_COUNTS = 20_000
FAST_COUNTS = 2_000_000  # up to 8.8 counts a microsecond: a latch at another instant gives another count


def readings(ticks: int, seed: int, first: int = 0) -> tuple[NDArray[np.uint16], NDArray[np.int32]]:
    """Conversions (ticks, 8, 2) and encoder counts (ticks, 2) of an arm that swings.

    The first encoder swings about the wrap of 32 bits signed, the second one fast about 0; both axes of the
    accelerometer carry noise, and the first one touches its rail now and then.
    """
    rng = np.random.default_rng([seed, first])
    t = (8 * first + np.arange(8 * ticks)) / 8000.0
    waves = np.stack(
        [2048 + 1900 * np.sin(2 * np.pi * 0.31 * t), 2048 + 700 * np.cos(2 * np.pi * 7.1 * t)], 1
    )
    waves += rng.normal(0.0, 60.0, waves.shape)
    adc = np.clip(np.rint(waves), 0, 4095).astype(np.uint16).reshape(ticks, 8, 2)
    turn = np.sin(2 * np.pi * 0.7 * t[7::8])
    counts = np.stack([2**31 - 5_000 + MARGIN_COUNTS * turn, FAST_COUNTS * turn], 1)
    return adc, np.rint(counts).astype(np.int64).astype(np.uint32).view(np.int32)
