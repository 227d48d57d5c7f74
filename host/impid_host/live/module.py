"""The module's latest samples: what the accelerometer felt at an instant, and those of the last seconds."""

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from impid_host.samples import DeviceSamples
from impid_host.signals.arrays import Floats
from impid_host.signals.counts import specific_force
from impid_host.study.model import AccelerometerSetup
from impid_host.wire.records import join_samples

# Samples come in batches of ten and then spend some milliseconds on the line; torques do not wait for them.
AHEAD_S = 0.05
_LINE = 30  # samples through which a straight line goes on for so long
_RECENT = 400


class Module:
    """Keeps what arrives, and no more than `kept_s` of it.

    Args:
        accelerometer: what its codes mean; None where there is none to be used.
    """

    def __init__(self, accelerometer: AccelerometerSetup | None, kept_s: float) -> None:
        self._accelerometer = accelerometer
        self._kept_us = kept_s * 1e6
        self._run: tuple[int, int] | None = None
        self._pieces: deque[DeviceSamples] = deque()
        self._t = np.zeros(0)
        self._felt = np.zeros((0, 2))

    def take(self, piece: Mapping[str, Any]) -> None:
        """Samples as the live view passes them on; a new run of the board begins anew."""
        run = (piece["boot_id"], piece["run"])
        if run != self._run:
            self._run = run
            self._pieces.clear()
            self._t, self._felt = self._t[:0], self._felt[:0]
        samples = _samples(piece)
        self._pieces.append(samples)
        while int(samples.t_us[-1]) - int(self._pieces[0].t_us[-1]) > self._kept_us:
            self._pieces.popleft()
        if self._accelerometer is not None:
            t = samples.t_us.astype(np.float64) * 1e-6 - self._accelerometer.delay_s
            felt = specific_force(samples, self._accelerometer)
            self._t = np.concatenate([self._t, t])[-_RECENT:]
            self._felt = np.concatenate([self._felt, felt])[-_RECENT:]

    @property
    def run(self) -> tuple[int, int] | None:
        """Boot and number of the run; None before the first sample."""
        return self._run

    @property
    def newest_s(self) -> float:
        """Up to when, on its clock, the accelerometer has told; minus infinity before it has."""
        return float(self._t[-1]) if len(self._t) else -np.inf

    @property
    def arrived_s(self) -> float | None:
        """Its clock at the newest sample; None before the first."""
        return float(self._pieces[-1].t_us[-1]) * 1e-6 if self._pieces else None

    def felt_at(self, t: Floats) -> Floats:
        """Specific force along the sensor's axes at instants (N,) of its clock, s: (N, 2), m/s^2.

        Beyond the newest sample the last 30 go on as a straight line. At least two samples must be there.
        """
        felt = np.stack([np.interp(t, self._t, axis) for axis in self._felt.T], axis=1)
        ahead = t > self._t[-1]
        if ahead.any():
            middle, level = self._t[-_LINE:].mean(), self._felt[-_LINE:].mean(axis=0)
            x = self._t[-_LINE:] - middle
            felt[ahead] = level + np.multiply.outer(t[ahead] - middle, x @ self._felt[-_LINE:] / (x @ x))
        return felt

    def knows(self, t: Floats) -> bool:
        """Whether all those instants lie where it has felt something, or not far beyond."""
        return bool(len(self._t) >= _LINE and t[0] >= self._t[0] and t[-1] <= self._t[-1] + AHEAD_S)

    def last(self) -> DeviceSamples | None:
        """All that is kept; None before the first sample."""
        return join_samples(list(self._pieces)) if self._pieces else None


def _samples(piece: Mapping[str, Any]) -> DeviceSamples:
    # The flags of a piece are those of all its samples together.
    return DeviceSamples(
        t_us=np.array(piece["t_us"], dtype=np.uint64),
        seq=(np.array(piece["index"], dtype=np.uint64) & 0xFFFFFFFF).astype(np.uint32),
        ax=np.array(piece["ax"], dtype=np.uint32),
        ay=np.array(piece["ay"], dtype=np.uint32),
        enc1=np.array(piece["enc1"], dtype=np.int32),
        enc2=np.array(piece["enc2"], dtype=np.int32),
        flags=np.full(len(piece["t_us"]), piece["flags"], dtype=np.uint8),
    )
