"""Encoder counters of 16 bits: their wraps are undone, and the turns before the first sample are counted.

A card with 16-bit counters logs an angle but for multiples of 65536 counts. Within a trial they go on;
how many there were before it began, the robot's own angle of the same joint tells.
"""

from dataclasses import replace

import numpy as np

from impid_host.samples import DeviceSamples, ModuleSamples
from impid_host.signals.counts import NARROW_BITS, counter_bits, encoder_counts, unwrap_counts
from impid_host.study.model import EncoderSetup, Floats


def narrow_joints(device: ModuleSamples) -> tuple[int, ...]:
    """The joints (from 0) whose 16-bit counter wraps in these samples."""
    counts = encoder_counts(device) or ()
    return tuple(joint for joint, column in enumerate(counts) if counter_bits(column) == NARROW_BITS)


def widened(
    device: ModuleSamples, narrow: tuple[int, ...], encoder: EncoderSetup, theta_robot: Floats
) -> ModuleSamples:
    """The samples with the counters of some joints continued.

    Args:
        narrow: those joints; where a counter does not wrap in this trial, its turns before are unknown too.
        theta_robot: the controller's angles in the same trial, at about the same time, (N, n), rad.
    """
    counts = list(encoder_counts(device) or ())
    for joint in narrow:
        whole = unwrap_counts(counts[joint], NARROW_BITS)
        per_count = encoder.direction[joint] * 2 * np.pi / encoder.counts_per_rev[joint]
        expected = (np.median(theta_robot[:, joint]) - encoder.zero_rad[joint]) / per_count
        wraps = np.round((expected - np.median(whole)) / (1 << NARROW_BITS))
        counts[joint] = (whole + int(wraps) * (1 << NARROW_BITS)).astype(np.int32)
    if isinstance(device, DeviceSamples):
        return replace(device, enc1=counts[0], enc2=counts[1])
    return replace(device, counts=np.stack(counts, axis=1))
