"""Raw numbers to physical ones: encoder counts to angles, ADC codes to specific force."""

import numpy as np
from numpy.typing import NDArray

from impid_host.errors import UndeterminedError
from impid_host.samples import (
    FLAG_ENCODER_FAULT,
    FLAG_RESET,
    FLAG_SATURATED,
    DeviceSamples,
    ForeignSamples,
    ModuleSamples,
)
from impid_host.signals.arrays import Floats, Mask
from impid_host.study.model import STANDARD_GRAVITY_M_S2, AccelerometerSetup, EncoderSetup

NARROW_BITS = 16
# Between two samples a 16-bit counter moves by far less than half its range; a wrap by nearly all of it.
_NARROW_MOTION = 1 << 13


def counter_bits(counts: NDArray[np.int32]) -> int:
    """How wide the counter is, (N,): 32 bits, or 16 where it stays within them and jumps by all of them."""
    wide = counts.astype(np.int64)
    if len(wide) < 2 or wide.max() - wide.min() >= 1 << NARROW_BITS:
        return 32
    steps = np.abs(np.diff(wide))
    far = steps > _NARROW_MOTION
    wraps = (1 << NARROW_BITS) - steps[far] < _NARROW_MOTION
    return NARROW_BITS if far.any() and wraps.all() else 32


def unwrap_counts(counts: NDArray[np.int32], bits: int = 32) -> NDArray[np.int64]:
    """Continue a signed counter of so many bits across its wraps, shape (N,); the first value stays as it is.

    Two successive samples are assumed less than half the counter's range apart.
    """
    wide = counts.astype(np.int64)
    if len(wide) == 0:
        return wide
    half = 1 << (bits - 1)
    steps = (np.diff(wide) + half) % (2 * half) - half
    return np.concatenate([wide[:1], wide[0] + np.cumsum(steps)])


def joint_angles(device: ModuleSamples, encoder: EncoderSetup | None) -> Floats:
    """Joint angles from the module's counters (study format, Conventions), or as a foreign module has them.

    Returns:
        shape (N, n), rad, n joints as `encoder` lists them (1 or 2).

    Raises:
        UndeterminedError: the module has no angles, or counts that the setup does not explain.
    """
    if isinstance(device, ForeignSamples) and device.theta is not None:
        return device.theta
    counts = encoder_counts(device)
    if counts is None:
        raise UndeterminedError("device.csv has no angles, neither enc1, enc2 nor theta1, theta2")
    if encoder is None:
        raise UndeterminedError("setup.toml has no [encoder]; add counts_per_rev, zero_rad and direction")
    channels = counts[: len(encoder.counts_per_rev)]
    columns = [
        zero + direction * unwrap_counts(counts) * (2 * np.pi / per_rev)
        for counts, per_rev, zero, direction in zip(
            channels, encoder.counts_per_rev, encoder.zero_rad, encoder.direction, strict=True
        )
    ]
    angles: Floats = np.stack(columns, axis=1)
    return angles


def has_angles(device: ModuleSamples) -> bool:
    """Whether the module knows the joints' angles, so that its clock can be matched by them."""
    return isinstance(device, DeviceSamples) or device.theta is not None or device.counts is not None


def encoder_counts(device: ModuleSamples) -> tuple[NDArray[np.int32], NDArray[np.int32]] | None:
    """The two counters as they were sent, shape (N,) each; None for a module without."""
    if isinstance(device, DeviceSamples):
        return device.enc1, device.enc2
    return None if device.counts is None else (device.counts[:, 0], device.counts[:, 1])


def specific_force(device: ModuleSamples, accelerometer: AccelerometerSetup) -> Floats:
    """Specific force along two right-angled axes at `mount_angle_rad`, shape (N, 2), m/s^2."""
    if isinstance(device, ForeignSamples) and device.acceleration is not None:
        along = device.acceleration
    else:
        along = _from_codes(device, accelerometer)
    return _squared(along, accelerometer.axis_angles_rad)


def _from_codes(device: ModuleSamples, accelerometer: AccelerometerSetup) -> Floats:
    codes = device.codes if isinstance(device, ForeignSamples) else np.stack([device.ax, device.ay], axis=1)
    if codes is None:
        raise UndeterminedError("device.csv has no acceleration, neither ax, ay nor acc_x, acc_y")
    volts = codes.astype(np.float64) / accelerometer.full_scale_code * accelerometer.vref_V
    in_g = (volts - np.array(accelerometer.zero_g_V)) / np.array(accelerometer.sensitivity_V_per_g)
    result: Floats = in_g * STANDARD_GRAVITY_M_S2
    return result


def _squared(along: Floats, axis_angles_rad: tuple[float, float]) -> Floats:
    """From axes turned by these angles to the right-angled ones that they should have been: (N, 2) each.

    The first axis reads cos(p) x + sin(p) y, the second -sin(q) x + cos(q) y (`calibration.accelerometer`).
    """
    p, q = axis_angles_rad
    if p == 0.0 and q == 0.0:
        return along
    axes = np.array([[np.cos(p), np.sin(p)], [-np.sin(q), np.cos(q)]])
    result: Floats = np.linalg.solve(axes, along.T).T
    return result


def usable_samples(device: ModuleSamples) -> Mask:
    """Samples whose angle and acceleration can be believed, shape (N,): not saturated, no encoder fault."""
    result: Mask = (device.flags & (FLAG_SATURATED | FLAG_ENCODER_FAULT)) == 0
    return result


def longest_run(device: ModuleSamples) -> slice:
    """The longest stretch without a reset: counters and clock restart at a reset, so stretches never mix."""
    broken = (device.flags[1:] & FLAG_RESET) != 0
    broken |= np.diff(device.t_us.astype(np.int64)) <= 0
    edges = np.concatenate([[0], np.flatnonzero(broken) + 1, [len(device)]])
    longest = int(np.argmax(np.diff(edges)))
    return slice(int(edges[longest]), int(edges[longest + 1]))
