"""Random errors of logged quantities, coloured as real ones are.

Each source draws the same number of random numbers for each row, so that how a caller divides time into
blocks changes nothing.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
Kind = Literal["white", "ar", "pink", "heteroscedastic", "speed", "student"]
LOWEST_HZ = 0.02  # pink noise is flat below: longer than any trial would need


@dataclass(frozen=True)
class NoiseTruth:
    """One source of noise, per channel.

    Attributes:
        kind: `white`; `ar`: first-order autoregression, -3 dB at corner_Hz; `pink`: density as 1/f from 0.02
            Hz to half the rate; `heteroscedastic`: white, in proportion to the quantity itself; `speed`:
            white, in proportion to the speed of the joint; `student`: white with heavy tails, Student's t
            with three degrees of freedom.
        rms: standard deviation of one logged value; for `heteroscedastic` its share of the quantity, for
            `speed` that at 1 rad/s.
        corner_Hz: for `ar`.
    """

    kind: Kind
    rms: tuple[float, float]
    corner_Hz: float = 5.0


class Noise:
    """A running source."""

    def __init__(self, truth: NoiseTruth, rate_Hz: float, generator: np.random.Generator) -> None:
        self._truth = truth
        self._generator = generator
        corners = {
            "ar": np.array([truth.corner_Hz]),
            "pink": _octaves(0.5 * rate_Hz),
        }.get(truth.kind, np.zeros(0))
        self._keep = np.exp(-2.0 * np.pi * corners / rate_Hz)
        # Equal power for each octave's source: the sum falls as 1/f.
        self._share = np.ones(corners.size) / np.sqrt(max(1, corners.size))
        self._state = [keep * generator.standard_normal((1, 2)) for keep in self._keep]

    def add_to(self, values: Array, speed: Array | None = None) -> Array:
        """The next values, shape (n, 2), with this noise on them.

        speed: of the joints, shape (n, 2), rad/s; None: at rest.
        """
        truth = self._truth
        rms = np.array(truth.rms)
        if not values.shape[0]:
            return values  # a filter given nothing would forget its state
        if truth.kind == "white":
            return np.asarray(values + rms * self._generator.standard_normal(values.shape))
        if truth.kind == "heteroscedastic":
            return np.asarray(values * (1.0 + rms * self._generator.standard_normal(values.shape)))
        if truth.kind == "speed":
            turning = np.zeros(values.shape) if speed is None else speed
            return np.asarray(values + rms * turning * self._generator.standard_normal(values.shape))
        if truth.kind == "student":
            normal = self._generator.standard_normal((values.shape[0], 2, 4))
            # A normal number over the root of a mean of three squares; its variance is 3.
            tails = normal[:, :, 0] / np.sqrt(np.mean(normal[:, :, 1:] ** 2, axis=2))
            return np.asarray(values + rms / np.sqrt(3.0) * tails)
        drive = self._generator.standard_normal((values.shape[0], self._keep.size, 2))
        noise = np.zeros(values.shape)
        for i, keep in enumerate(self._keep):
            part, self._state[i] = lfilter(
                [np.sqrt(1.0 - keep**2)], [1.0, -keep], drive[:, i], axis=0, zi=self._state[i]
            )
            noise += self._share[i] * part
        return np.asarray(values + rms * noise)


def _octaves(highest_Hz: float) -> Array:
    count = int(np.floor(np.log2(highest_Hz / LOWEST_HZ)))
    return np.asarray(LOWEST_HZ * np.exp2(np.arange(count + 1)))
