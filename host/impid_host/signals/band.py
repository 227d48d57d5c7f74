"""The band of a motion, by its velocity's power, and the default chain's cut-off, which follows it."""

from collections.abc import Sequence

import numpy as np

from impid_host.signals.arrays import Floats
from impid_host.signals.chain import PUBLISHED_CUTOFF_HZ, Chain
from impid_host.signals.density import power_density

# A joint rests below this share of the quickest joint's rms velocity (1 m/s counted as 1 rad/s): its own
# friction and inertia are then smaller than what any model of the others leaves over.
RESTS = 0.01
_MOST_OF_SPEED = 0.99  # of its power
_HARMONICS = 2.0  # products of two signals of a band reach twice as far
_WIDEST_HZ = (
    40.0  # the filter ahead of all derivatives, which torque does not pass, takes 4 % of what lies there
)
HIGHEST_OF_RATE = 0.4  # of a log: above, it says nothing
_HIGHEST_HZ = 60.0  # of the filter ahead of all derivatives
_CERTAINLY = 5.0  # times the noise's density: one period in a thousand exceeds it by chance
_WINDOW_S = 8.0


def motion_band_hz(t: Floats, theta: Floats) -> float:
    """Frequency below which 99 % of the velocity's power lies, the widest of the joints that move.

    Noise of the encoders, even in the angle and so growing in the velocity, is taken off first.

    Args:
        t: s, (N,), increasing; theta: (N, n).
    """
    rate = 1 / float(np.median(np.diff(t)))
    uniform = np.arange(t[0], t[-1], 1 / rate)
    bands, speeds = [], []
    for joint in theta.T:
        speed = np.gradient(np.interp(uniform, t, joint)) * rate
        frequency, power = power_density(
            speed, rate, min(len(speed), int(_WINDOW_S * rate)), rid_of_mean=False
        )
        power = np.maximum(power - _noise(frequency, power, min(_HIGHEST_HZ, HIGHEST_OF_RATE * rate)), 0.0)
        speeds.append(float(np.sqrt(power.sum())))
        share = np.cumsum(power) / max(float(power.sum()), 1e-300)
        bands.append(float(frequency[np.argmax(share >= _MOST_OF_SPEED)]))
    moving = [band for band, speed in zip(bands, speeds, strict=True) if speed >= RESTS * max(speeds)]
    return max(moving)


def _noise(frequency: Floats, power: Floats, highest: float) -> Floats:
    """Density of a velocity's noise: even in the angle, as the upper half of the band has it."""
    square = (2 * np.pi * frequency) ** 2
    top = (frequency > 0.5 * highest) & (frequency < highest)
    level = float(np.median(power[top] / square[top])) if top.any() else 0.0
    noise = np.where(frequency < highest, _CERTAINLY * level * square, np.inf)
    return np.asarray(noise, dtype=np.float64)


def following(chain: Chain, bands_hz: Sequence[float]) -> Chain:
    """The chain with a cut-off twice the widest of the motions' bands: 4.5 Hz at least, 40 Hz at most.

    [D] moves below 2 Hz and cuts off at 4.5 Hz.
    """
    cutoff = float(np.clip(_HARMONICS * max(bands_hz, default=0.0), PUBLISHED_CUTOFF_HZ, _WIDEST_HZ))
    return chain if cutoff == PUBLISHED_CUTOFF_HZ else chain.with_cutoff(round(cutoff, 1))
