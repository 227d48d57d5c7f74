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
        angle_rad: the sensor stands turned by this, counter-clockwise.
        cross_axis: share of the other axis seen by each axis.
        drift_N_per_s, drift_from_s: the zero moves at this rate; at that time it is offset_N.
        delay_s: the reading is that of so long ago; negative: early.
        quantum_N: the reading comes in steps of this; 0: as a double.
    """

    noise: tuple[NoiseTruth, ...]
    offset_N: tuple[float, float] = (0.0, 0.0)
    gain_error: tuple[float, float] = (0.0, 0.0)
    quantum_N: float = 0.0
    angle_rad: float = 0.0
    cross_axis: tuple[float, float] = (0.0, 0.0)
    drift_N_per_s: tuple[float, float] = (0.0, 0.0)
    drift_from_s: float = 0.0
    delay_s: float = 0.0


class ForceSensor:
    """Adds what the sensor adds to the true force."""

    def __init__(self, truth: ForceSensorTruth, rate_Hz: float, generator: np.random.Generator) -> None:
        """rate_Hz: of the readings."""
        self._truth = truth
        streams = generator.spawn(len(truth.noise))
        self._noise = [
            Noise(source, rate_Hz, stream) for source, stream in zip(truth.noise, streams, strict=True)
        ]

    @property
    def delay_s(self) -> float:
        """The reading is that of so long ago."""
        return self._truth.delay_s

    def read(self, force: Array, since_s: Array) -> Array:
        """Logged force of the load on the robot, base frame, shape (n, 2), N.

        Args:
            force: mean over the sample period centred on each logged instant less the delay, shape (n, 2), N.
            since_s: time of the rows since the trial began, shape (n,), s.
        """
        truth = self._truth
        cosine, sine = np.cos(truth.angle_rad), np.sin(truth.angle_rad)
        turned = force @ np.array([[cosine, -sine], [sine, cosine]])
        crossed = turned + np.array(truth.cross_axis) * turned[:, ::-1]
        zero = np.array(truth.offset_N) + np.outer(since_s - truth.drift_from_s, truth.drift_N_per_s)
        reading = crossed * (1.0 + np.array(truth.gain_error)) + zero
        for noise in self._noise:
            reading = noise.add_to(reading)
        if truth.quantum_N > 0.0:
            reading = truth.quantum_N * np.round(reading / truth.quantum_N)
        return np.asarray(reading)
