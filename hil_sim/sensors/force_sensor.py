"""The physical force sensor between robot and load, as the robot's log shows it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ForceSensorTruth:
    """noise_N: standard deviation of one logged value, per axis."""

    noise_N: tuple[float, float]


class ForceSensor:
    """Adds what the sensor adds to the true force."""

    def __init__(self, truth: ForceSensorTruth, generator: np.random.Generator) -> None:
        self._truth = truth
        self._generator = generator

    def read(self, force: Array) -> Array:
        """Logged force of the load on the robot, base frame, shape (n, 2), N.

        Args:
            force: mean over the sample period centred on each logged instant, shape (n, 2), N.
        """
        noise: Array = self._generator.standard_normal(force.shape) * np.array(self._truth.noise_N)
        return force + noise
