"""The sensor board off the robot, upright on a dividing head: what calibration by gravity needs.

It rests while the board streams. When a stream ends the head goes on by one position, as the person at the
bench turns it between two readings. Stands in the place of the `World`: the same sensor, converter and noise.
"""

import numpy as np

from hil_sim.errors import SimError
from hil_sim.seeds import generator
from hil_sim.sensors.accelerometer import Output
from hil_sim.sensors.adc import CONVERSIONS
from hil_sim.world import CONVERSION_US, Readings, TrialTruth, converter


class Turntable:
    """Positions 0, 360/n, 2 * 360/n, ... degrees from the board's x axis to the vertical."""

    def __init__(self, truth: TrialTruth, positions: int) -> None:
        """A sensor with the errors of this trial's.

        Raises:
            SimError: fewer than one position.
        """
        if positions < 1:
            raise SimError("--tumble: give at least one position, e.g. 8")
        self._step_rad = 2.0 * np.pi / positions
        self._position = 0
        self._streamed = False
        self._output = Output(
            truth.accelerometer,
            1e-6 * CONVERSION_US,
            generator(truth.seed, truth.name, "accelerometer noise"),
        )
        self._converter = converter(truth, 0.0)

    def __call__(self, readings: Readings, *, streaming: bool, self_test: bool) -> Readings:
        """What the board reads on the head instead."""
        self._position += self._streamed and not streaming
        self._streamed = streaming
        ticks = len(readings.encoder)
        angle = self._step_rad * self._position
        upwards_g = np.tile([np.cos(angle), np.sin(angle)], (ticks * CONVERSIONS, 1))
        volts = self._output.volts(upwards_g, self_test=self_test)
        codes = self._converter.readings(volts, self_test=self_test)
        return Readings(adc=codes, encoder=np.zeros_like(readings.encoder))
