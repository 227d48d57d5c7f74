"""What the robot's controller is told to follow: ten sinusoids per joint, [D] Sec. II-C and Appendix.

A reference is a function of time alone, so any block of it can be had at any time. It rests at its
centre before the start, swells in smoothly, and swells out after the trial's duration.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Ticks(Protocol):
    """Rows of what the controller follows, by the number of its tick."""

    def ticks(self, first: int, count: int) -> Array:
        """Rows for ticks first to first + count - 1, shape (count, 4); see Plant.run."""


class Course(Protocol):
    """What the controller follows."""

    @property
    def start_rad(self) -> Array:
        """Joint angles at which the robot rests before the start, shape (2,)."""

    def ticked(self, tick_s: float) -> Ticks:
        """On the ticks of a controller with this period."""


@dataclass(frozen=True)
class Reference:
    """A sum of sinusoids about a centre, in joint space.

    Attributes:
        centre_rad: shape (2,).
        amplitude_rad: shape (n, 2).
        frequency_Hz: shape (n, 2).
        phase_rad: shape (n, 2).
        ramp_s: time to swell in, and out again.
        duration_s: when it begins to swell out.
    """

    centre_rad: Array
    amplitude_rad: Array
    frequency_Hz: Array
    phase_rad: Array
    ramp_s: float
    duration_s: float

    @property
    def start_rad(self) -> Array:
        """Joint angles at which the robot rests before the start, shape (2,)."""
        return self.centre_rad

    def ticked(self, tick_s: float) -> "TickedReference":
        """On the ticks of a controller with this period."""
        return TickedReference(self, tick_s)

    def at(self, t_s: Array) -> Array:
        """Reference angles and speeds.

        Args:
            t_s: seconds since the start on the robot's clock, shape (n,).

        Returns:
            q1, q2 (rad), w1, w2 (rad/s), shape (n, 4).
        """
        angular = 2.0 * np.pi * self.frequency_Hz
        wave = np.zeros((t_s.size, 2))
        wave_rate = np.zeros((t_s.size, 2))
        for amplitude, omega, phase in zip(self.amplitude_rad, angular, self.phase_rad, strict=True):
            argument = t_s[:, None] * omega + phase
            wave += amplitude * np.sin(argument)
            wave_rate += amplitude * omega * np.cos(argument)
        gate, gate_rate = self.gate(t_s)
        q = self.centre_rad + gate[:, None] * wave
        w = gate[:, None] * wave_rate + gate_rate[:, None] * wave
        return np.hstack([q, w])

    def gate(self, t_s: Array) -> tuple[Array, Array]:
        """Rises from 0 to 1 and falls back with continuous acceleration; and its rate, 1/s."""
        rise, rise_rate = _smooth_step(t_s / self.ramp_s)
        fall, fall_rate = _smooth_step((t_s - self.duration_s) / self.ramp_s)
        return rise - fall, (rise_rate - fall_rate) / self.ramp_s


def _smooth_step(u: Array) -> tuple[Array, Array]:
    """The quintic from 0 to 1 with zero slope and curvature at both ends, and its derivative."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 + u * (6.0 * u - 15.0)), 30.0 * (u * (1.0 - u)) ** 2


def ten_sinusoids(
    *,
    centre_rad: Array,
    range_deg: float,
    highest_Hz: float,
    ramp_s: float,
    duration_s: float,
    generator: np.random.Generator,
) -> Reference:
    """Ten sinusoids of equal amplitude per joint, one in each tenth of the band, phases at random.

    Each joint's sum is scaled so that it spans `range_deg` over the trial.
    """
    count = 10
    band = highest_Hz / count
    edges = band * np.arange(count)[:, None]
    frequency = edges + band * generator.uniform(0.2, 1.0, (count, 2))
    phase = generator.uniform(0.0, 2.0 * np.pi, (count, 2))
    ones = np.ones((count, 2))
    raw = Reference(np.zeros(2), ones, frequency, phase, ramp_s, duration_s)
    # 100 Hz shows a 2 Hz wave's extremes to 0.2 %.
    wave = raw.at(np.arange(0.0, duration_s, 0.01))[:, :2]
    scale = np.deg2rad(range_deg) / (wave.max(axis=0) - wave.min(axis=0))
    return Reference(centre_rad, ones * scale, frequency, phase, ramp_s, duration_s)


class TickedReference:
    """A reference on the controller's ticks, computed in whole chunks.

    Within a chunk each sinusoid is a fixed table turned by the phase at the chunk's start, which spares most
    sines. The chunks stand at fixed places, so that the values do not depend on how the caller divides the
    ticks.
    """

    CHUNK = 1000

    def __init__(self, reference: Reference, tick_s: float) -> None:
        self._reference = reference
        self._tick_s = tick_s
        self._omega = 2.0 * np.pi * reference.frequency_Hz
        steps = np.arange(self.CHUNK) * tick_s
        self._table = np.exp(1j * steps[:, None, None] * self._omega)  # (chunk, n, 2)
        self._cached: tuple[int, Array] | None = None

    def ticks(self, first: int, count: int) -> Array:
        """Rows of q1, q2, w1, w2 for ticks first to first + count - 1, shape (count, 4)."""
        rows = []
        at, end = first, first + count
        while at < end:
            number, offset = divmod(at, self.CHUNK)
            take = min(self.CHUNK - offset, end - at)
            rows.append(self._chunk(number)[offset : offset + take])
            at += take
        return np.concatenate(rows) if rows else np.empty((0, 4))

    def _chunk(self, number: int) -> Array:
        if self._cached is None or self._cached[0] != number:
            self._cached = (number, self._compute(number))
        return self._cached[1]

    def _compute(self, number: int) -> Array:
        reference = self._reference
        t_s = (number * self.CHUNK + np.arange(self.CHUNK, dtype=np.float64)) * self._tick_s
        phasor = reference.amplitude_rad * np.exp(1j * (t_s[0] * self._omega + reference.phase_rad))
        # sin is the imaginary part of the turning phasor, its derivative omega times the real part.
        wave = np.einsum("knj,nj->kj", self._table, phasor).imag
        wave_rate = np.einsum("knj,nj->kj", self._table, phasor * self._omega).real
        gate, gate_rate = reference.gate(t_s)
        q = reference.centre_rad + gate[:, None] * wave
        w = gate[:, None] * wave_rate + gate_rate[:, None] * wave
        return np.hstack([q, w])
