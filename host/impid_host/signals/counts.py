"""Raw numbers to physical ones: encoder counts to angles, ADC codes to specific force."""

import numpy as np
from numpy.typing import NDArray

from impid_host.samples import FLAG_ENCODER_FAULT, FLAG_RESET, FLAG_SATURATED, DeviceSamples
from impid_host.signals.arrays import Floats, Mask
from impid_host.study.model import STANDARD_GRAVITY_M_S2, AccelerometerSetup, EncoderSetup


def unwrap_counts(counts: NDArray[np.int32]) -> NDArray[np.int64]:
    """Continue a signed 32-bit counter across its wraps, shape (N,); the first value stays as it is.

    Two successive samples are assumed less than 2**31 counts apart.
    """
    wide = counts.astype(np.int64)
    if len(wide) == 0:
        return wide
    steps = np.diff(wide)
    steps = (steps + 2**31) % 2**32 - 2**31
    return np.concatenate([wide[:1], wide[0] + np.cumsum(steps)])


def joint_angles(device: DeviceSamples, encoder: EncoderSetup) -> Floats:
    """Joint angles from the module's counters (study format, Conventions).

    Returns:
        shape (N, n), rad, n joints as `encoder` lists them (1 or 2).
    """
    channels = (device.enc1, device.enc2)[: len(encoder.counts_per_rev)]
    columns = [
        zero + direction * unwrap_counts(counts) * (2 * np.pi / per_rev)
        for counts, per_rev, zero, direction in zip(
            channels, encoder.counts_per_rev, encoder.zero_rad, encoder.direction, strict=True
        )
    ]
    angles: Floats = np.stack(columns, axis=1)
    return angles


def specific_force(device: DeviceSamples, accelerometer: AccelerometerSetup) -> Floats:
    """Specific force along the sensor's own axes, shape (N, 2), m/s^2."""
    codes = np.stack([device.ax, device.ay], axis=1).astype(np.float64)
    volts = codes / accelerometer.full_scale_code * accelerometer.vref_V
    in_g = (volts - np.array(accelerometer.zero_g_V)) / np.array(accelerometer.sensitivity_V_per_g)
    result: Floats = in_g * STANDARD_GRAVITY_M_S2
    return result


def usable_samples(device: DeviceSamples) -> Mask:
    """Samples whose angle and acceleration can be believed, shape (N,): not saturated, no encoder fault."""
    result: Mask = (device.flags & (FLAG_SATURATED | FLAG_ENCODER_FAULT)) == 0
    return result


def longest_run(device: DeviceSamples) -> slice:
    """The longest stretch without a reset: counters and clock restart at a reset, so stretches never mix."""
    broken = (device.flags[1:] & FLAG_RESET) != 0
    broken |= np.diff(device.t_us.astype(np.int64)) <= 0
    edges = np.concatenate([[0], np.flatnonzero(broken) + 1, [len(device)]])
    longest = int(np.argmax(np.diff(edges)))
    return slice(int(edges[longest]), int(edges[longest + 1]))
