"""The ADXL203 on the end-effector, from the motion to its two output voltages.

Source: Analog Devices, ADXL103/ADXL203 data sheet (ratiometric output, noise density, output filter by a
capacitor against the internal 32 kOhm, self-test). In a horizontal plane specific force is acceleration.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
STANDARD_GRAVITY = 9.80665  # m/s^2


@dataclass(frozen=True)
class AccelerometerTruth:
    """What this one sensor really does.

    Attributes:
        zero_g_V: nominal output at 0 g, per axis.
        sensitivity_V_per_g: nominal, per axis.
        supply_V: the output cannot leave 0 to this.
        turns_with_link2: the axes turn with q2; otherwise they stay along x and y.
        mount_angle_rad: from link 2's x' axis (or from x) to the first axis, the real one.
        bandwidth_Hz: corner of the first-order output filter.
        noise_density_ug_per_rtHz: white noise ahead of that filter.
        offset_mg: departure from zero_g_V, per axis.
        gain_error: relative departure from the sensitivity, per axis.
        cross_axis: share of the other axis seen by each axis.
        self_test_g: what the output shifts by while the self-test pin is driven.
    """

    zero_g_V: tuple[float, float]
    sensitivity_V_per_g: tuple[float, float]
    supply_V: float
    turns_with_link2: bool
    mount_angle_rad: float
    bandwidth_Hz: float
    noise_density_ug_per_rtHz: float
    offset_mg: tuple[float, float]
    gain_error: tuple[float, float]
    cross_axis: tuple[float, float]
    self_test_g: tuple[float, float]


class OutputFilter:
    """The output filter driven by the motion, on the grid of the plant.

    Over each substep the drive is taken as its mean, which makes the recursion exact for the steps
    that the held torque gives to the acceleration.
    """

    def __init__(self, truth: AccelerometerTruth, step_s: float) -> None:
        self._truth = truth
        self.rate = 2.0 * np.pi * truth.bandwidth_Hz  # 1/s
        self._keep = float(np.exp(-self.rate * step_s))
        self._state = np.zeros((1, 2))

    def drive(self, q: Array, acceleration: Array) -> tuple[Array, Array]:
        """Specific force along the sensor's axes and the filter's response to it.

        Args:
            q: joint angles at the n + 1 grid points around n substeps, shape (n + 1, 2), rad.
            acceleration: of the end-effector in the base frame, mean over each substep, shape (n, 2), m/s^2.

        Returns:
            Mean specific force over each substep and filter output at its end, g, both shape (n, 2).
        """
        specific = self._along_axes(q, acceleration) / STANDARD_GRAVITY
        response, self._state = lfilter(
            [1.0 - self._keep], [1.0, -self._keep], specific, axis=0, zi=self._state
        )
        return specific, response

    def _along_axes(self, q: Array, acceleration: Array) -> Array:
        angle = np.full(acceleration.shape[0], self._truth.mount_angle_rad)
        if self._truth.turns_with_link2:
            angle += 0.5 * (q[:-1, 1] + q[1:, 1])
        cosine, sine = np.cos(angle), np.sin(angle)
        first = cosine * acceleration[:, 0] + sine * acceleration[:, 1]
        second = cosine * acceleration[:, 1] - sine * acceleration[:, 0]
        return np.stack([first, second], axis=1)


class Output:
    """What adds to the filtered motion up to the pins: noise, self-test, gain, zero and the rails."""

    def __init__(self, truth: AccelerometerTruth, interval_s: float, generator: np.random.Generator) -> None:
        """interval_s: nominal time between conversions."""
        self._truth = truth
        self._generator = generator
        rate = 2.0 * np.pi * truth.bandwidth_Hz
        self._keep = float(np.exp(-rate * interval_s))
        # A first-order low-pass with corner f lets pi/2 f of white noise through.
        self._noise_g = 1e-6 * truth.noise_density_ug_per_rtHz * np.sqrt(0.5 * np.pi * truth.bandwidth_Hz)
        start = self._noise_g * generator.standard_normal((1, 2))
        self._noise_state = self._keep * start
        self._self_test = 0.0

    def volts(self, filtered_g: Array, *, self_test: bool = False) -> Array:
        """Voltages at consecutive conversions.

        Args:
            filtered_g: response of the output filter to the motion, shape (n, 2), g.
            self_test: the self-test pin is driven during these conversions.

        Returns:
            Shape (n, 2), V.
        """
        truth = self._truth
        felt = filtered_g + self._noise(filtered_g.shape[0])
        felt += self._self_test_response(filtered_g.shape[0], driven=self_test)
        crossed = felt + np.array(truth.cross_axis) * felt[:, ::-1]
        gain = np.array(truth.sensitivity_V_per_g) * (1.0 + np.array(truth.gain_error))
        zero = np.array(truth.zero_g_V) + 1e-3 * np.array(truth.offset_mg) * np.array(
            truth.sensitivity_V_per_g
        )
        return np.asarray(np.clip(zero + gain * crossed, 0.0, truth.supply_V))

    def _noise(self, count: int) -> Array:
        """White noise behind the filter, sampled: a first-order autoregression with its variance."""
        drive = self._noise_g * np.sqrt(1.0 - self._keep**2) * self._generator.standard_normal((count, 2))
        noise, self._noise_state = lfilter([1.0], [1.0, -self._keep], drive, axis=0, zi=self._noise_state)
        return np.asarray(noise)

    def _self_test_response(self, count: int, *, driven: bool) -> Array:
        """The pin moves the element ahead of the filter, so the shift settles with the filter."""
        target = 1.0 if driven else 0.0
        settle = target + (self._self_test - target) * self._keep ** np.arange(1, count + 1)
        if count:
            self._self_test = float(settle[-1])
        return np.asarray(settle[:, None] * np.array(self._truth.self_test_g))
