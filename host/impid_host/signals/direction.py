"""The direction of a motion within a sample, where it may reverse."""

import numpy as np

from impid_host.signals.arrays import Floats


def sign_mean(omega: Floats, acc: Floats, dt: float) -> Floats:
    """sign(omega) averaged over a sample of `dt` s: a reversal between two instants keeps its time."""
    reach = np.maximum(0.5 * dt * np.abs(acc), 1e-12)
    return np.clip(omega / reach, -1.0, 1.0)
