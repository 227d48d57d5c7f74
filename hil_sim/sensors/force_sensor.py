"""The physical force sensor between robot and load, as the robot's log shows it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil_sim.sensors.noise import Noise, NoiseTruth

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ForceSensorTruth:
    """How this sensor errs.

    Attributes:
        noise: they add up.
        offset_N: per axis.
        gain_error: relative, per axis.
        quantum_N: the reading comes in steps of this; 0: as a double.
    """

    noise: tuple[NoiseTruth, ...]
    offset_N: tuple[float, float] = (0.0, 0.0)
    gain_error: tuple[float, float] = (0.0, 0.0)
    quantum_N: float = 0.0


class ForceSensor:
    """Adds what the sensor adds to the true force."""

    def __init__(self, truth: ForceSensorTruth, rate_Hz: float, generator: np.random.Generator) -> None:
        """rate_Hz: of the readings."""
        self._truth = truth
        streams = generator.spawn(len(truth.noise))
        self._noise = [
            Noise(source, rate_Hz, stream) for source, stream in zip(truth.noise, streams, strict=True)
        ]

    def read(self, force: Array) -> Array:
        """Logged force of the load on the robot, base frame, shape (n, 2), N.

        Args:
            force: mean over the sample period centred on each logged instant, shape (n, 2), N.
        """
        truth = self._truth
        reading = force * (1.0 + np.array(truth.gain_error)) + np.array(truth.offset_N)
        for noise in self._noise:
            reading = noise.add_to(reading)
        if truth.quantum_N > 0.0:
            reading = truth.quantum_N * np.round(reading / truth.quantum_N)
        return np.asarray(reading)
