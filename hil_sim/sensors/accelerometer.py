"""The ADXL203 on the end-effector, from the motion to its two output voltages.

Source: Analog Devices, ADXL103/ADXL203 data sheet (ratiometric output, noise density, output filter by a
capacitor against the internal 32 kOhm, self-test). Specific force is acceleration minus gravity; in a level
plane the latter has no part.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import bilinear, lfilter, lfilter_zi

Array = NDArray[np.float64]
STANDARD_GRAVITY = 9.80665  # m/s^2


@dataclass(frozen=True)
class Bracket:
    """What the sensor is mounted on: of the specific force at its foot, `share` goes through a resonance.

    One mode of a structure that its foot shakes: (2 d w s + w^2) / (s^2 + 2 d w s + w^2).
    """

    share: float
    frequency_Hz: float
    damping_ratio: float


@dataclass(frozen=True)
class AccelerometerTruth:
    """What this one sensor really does.

    Attributes:
        zero_g_V: nominal output at 0 g, per axis.
        sensitivity_V_per_g: nominal, per axis.
        supply_V: real supply; the output is ratiometric to it and cannot leave 0 to this.
        nominal_supply_V: the one for which zero and sensitivity are stated.
        turns_with_link2: the axes turn with q2; otherwise they stay along x and y.
        mount_angle_rad: from link 2's x' axis (or from x) to the first axis, the real one.
        bandwidth_Hz: corner of the first-order output filter.
        noise_density_ug_per_rtHz: white noise ahead of that filter.
        offset_mg: departure from zero_g_V, per axis.
        gain_error: relative departure from the sensitivity, per axis.
        cross_axis: share of the other axis seen by each axis.
        self_test_g: what the output shifts by while the self-test pin is driven.
        lever_m: from the end point to the sensor, along its axes.
        gravity_m_s2: in the plane, base frame.
        bracket: what it is mounted on; None: it is stiff.
        warm_up_C, warm_up_s: how much the sensor warms up after the start, and its time constant.
        offset_mg_per_C, gain_per_C: what the warmth does to zero and gain, per axis.
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
    nominal_supply_V: float | None = None
    lever_m: tuple[float, float] = (0.0, 0.0)
    gravity_m_s2: tuple[float, float] = (0.0, 0.0)
    bracket: Bracket | None = None
    warm_up_C: float = 0.0
    warm_up_s: float = 600.0
    offset_mg_per_C: tuple[float, float] = (0.1, 0.1)
    gain_per_C: tuple[float, float] = (0.0, 0.0)


class OutputFilter:
    """The output filter driven by the motion, on the grid of the plant.

    Over each substep the drive is taken as its mean, which makes the recursion exact for the steps
    that the held torque gives to the acceleration.
    """

    def __init__(self, truth: AccelerometerTruth, step_s: float) -> None:
        self._truth = truth
        self._step_s = step_s
        self.rate = 2.0 * np.pi * truth.bandwidth_Hz  # 1/s
        self._keep = float(np.exp(-self.rate * step_s))
        self._state = np.zeros((1, 2))
        self._ringing = None if truth.bracket is None else Ringing(truth.bracket, step_s)

    def rest(self, q: Array) -> Array:
        """The filter has settled at joint angles q, shape (2,): its output, g."""
        at = np.stack([q, q])
        if self._ringing is not None:
            felt = -np.array([self._truth.gravity_m_s2])
            self._ringing.rest(self._along_axes(at, felt) / STANDARD_GRAVITY)
        specific, _ = self.drive(at, np.zeros((1, 2)))
        self._state = self._keep * specific
        return np.asarray(specific[0])

    def drive(self, q: Array, acceleration: Array, w: Array | None = None) -> tuple[Array, Array]:
        """Specific force along the sensor's axes and the filter's response to it.

        Args:
            q: joint angles at the n + 1 grid points around n substeps, shape (n + 1, 2), rad.
            acceleration: of the end-effector in the base frame, mean over each substep, shape (n, 2), m/s^2.
            w: joint speeds at the grid points, shape (n + 1, 2), rad/s; may be left out for a sensor without
            lever.

        Returns:
            Mean specific force over each substep and filter output at its end, g, both shape (n, 2).
        """
        felt = acceleration - np.array(self._truth.gravity_m_s2)
        specific = self._along_axes(q, felt)
        if w is not None and any(self._truth.lever_m):
            specific += self._lever(w)
        specific /= STANDARD_GRAVITY
        if self._ringing is not None:
            specific = self._ringing.felt(specific)
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

    def _lever(self, w: Array) -> Array:
        """Turning gives a place beside the end point another acceleration: turn' x l - turn^2 l."""
        if not self._truth.turns_with_link2:
            return np.zeros((w.shape[0] - 1, 2))
        lx, ly = self._truth.lever_m
        swing = np.diff(w[:, 1]) / self._step_s
        # Mean of the square over a substep in which the speed changes evenly.
        spin = (w[:-1, 1] ** 2 + w[:-1, 1] * w[1:, 1] + w[1:, 1] ** 2) / 3.0
        return np.stack([-spin * lx - swing * ly, swing * lx - spin * ly], axis=1)


class Ringing:
    """The bracket on the grid of the plant, by the bilinear rule: at 8 kHz it is exact to a millionth."""

    def __init__(self, bracket: Bracket, step_s: float) -> None:
        omega = 2.0 * np.pi * bracket.frequency_Hz
        damped = 2.0 * bracket.damping_ratio * omega
        self._b, self._a = bilinear([damped, omega**2], [1.0, damped, omega**2], 1.0 / step_s)
        self._share = bracket.share
        self._state = np.zeros((2, 2))

    def rest(self, specific: Array) -> None:
        """Has always felt this, shape (1, 2)."""
        self._state = lfilter_zi(self._b, self._a)[:, None] * specific

    def felt(self, specific: Array) -> Array:
        """What the sensor feels of what its foot does, both shape (n, 2)."""
        rung, self._state = lfilter(self._b, self._a, specific, axis=0, zi=self._state)
        return np.asarray(specific + self._share * (rung - specific))


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
        self._interval_s = interval_s
        self._conversions = 0

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
        warmth = self._warmth(filtered_g.shape[0])
        sensitivity = np.array(truth.sensitivity_V_per_g)
        gain = sensitivity * (1.0 + np.array(truth.gain_error) + warmth * np.array(truth.gain_per_C))
        offset_g = 1e-3 * (np.array(truth.offset_mg) + warmth * np.array(truth.offset_mg_per_C))
        zero = np.array(truth.zero_g_V) + offset_g * sensitivity
        ratio = truth.supply_V / (truth.nominal_supply_V or truth.supply_V)
        return np.asarray(np.clip(ratio * (zero + gain * crossed), 0.0, truth.supply_V))

    def _warmth(self, count: int) -> Array:
        """How much warmer than at the start, shape (n, 1), degrees."""
        t_s = self._interval_s * (self._conversions + np.arange(count)[:, None])
        self._conversions += count
        if self._truth.warm_up_C == 0.0:
            return np.zeros((1, 1))
        return np.asarray(self._truth.warm_up_C * -np.expm1(-t_s / self._truth.warm_up_s))

    def _noise(self, count: int) -> Array:
        """White noise behind the filter, sampled: a first-order autoregression with its variance."""
        drive = self._noise_g * np.sqrt(1.0 - self._keep**2) * self._generator.standard_normal((count, 2))
        noise, self._noise_state = lfilter([1.0], [1.0, -self._keep], drive, axis=0, zi=self._noise_state)
        return np.asarray(noise)

    def _self_test_response(self, count: int, *, driven: bool) -> Array:
        """The pin moves the element ahead of the filter, so the shift settles with the filter."""
        if not driven and self._self_test == 0.0:
            return np.zeros((1, 2))
        target = 1.0 if driven else 0.0
        settle = target + (self._self_test - target) * self._keep ** np.arange(1, count + 1)
        if count:
            self._self_test = float(settle[-1])
        return np.asarray(settle[:, None] * np.array(self._truth.self_test_g))
