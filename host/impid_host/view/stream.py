"""What the page shows of the stream: physical values at about 100 Hz, and a spectrum of the last seconds."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from impid_host.signals.arrays import Floats
from impid_host.view.scale import Scale
from impid_host.view.spectrum import HIGHEST_HZ, SEGMENT, amplitude_spectrum

SHOWN_HZ = 100.0
_KEPT = 3 * SEGMENT  # samples behind a spectrum
_MOST_POINTS = 1000  # that wait for the next push: ten seconds
_DIGITS = 5

Points = dict[str, list[float]]


class Stream:
    """Full-rate pieces in, means over some samples out. Holds a bounded number of values, whatever comes in.

    Args:
        scale: of the board that sends.
        rate_hz: nominal rate of its samples.
    """

    def __init__(self, scale: Scale, rate_hz: float) -> None:
        self.scale = scale
        self._rate_hz = rate_hz
        self._step = max(1, round(rate_hz / SHOWN_HZ))
        self._run: tuple[int, int] | None = None
        self._first_us = 0
        self._next_index = 0
        self._rest = np.zeros((0, 5))  # t, ax, ay, angles: not enough yet for another point
        self._recent = np.zeros((0, 2))
        self._points = np.zeros((0, 5))

    def take(self, piece: Mapping[str, Any]) -> None:
        """A piece of one run: index, t_us, ax, ay, enc1, enc2."""
        run = (piece["boot_id"], piece["run"])
        if run != self._run:
            self._run, self._first_us = run, int(piece["t_us"][0])
            self._cut()
            self._points = self._points[:0]
        elif piece["index"][0] != self._next_index:
            self._cut()  # a spectrum across a hole would show the hole
        self._next_index = piece["index"][-1] + 1
        acc = self.scale.acceleration(np.stack([piece["ax"], piece["ay"]], axis=1))
        angles = self.scale.angles(np.stack([piece["enc1"], piece["enc2"]], axis=1))
        t = (np.asarray(piece["t_us"], dtype=np.int64) - self._first_us) * 1e-6
        rows = np.concatenate([self._rest, np.column_stack([t, acc, angles])])
        whole = len(rows) - len(rows) % self._step
        means = rows[:whole].reshape(-1, self._step, 5).mean(axis=1)
        self._rest = rows[whole:]
        self._points = np.concatenate([self._points, means])[-_MOST_POINTS:]
        self._recent = np.concatenate([self._recent, acc])[-_KEPT:]

    @property
    def run(self) -> tuple[int, int] | None:
        """Boot and number of the run that is shown; None before the first piece."""
        return self._run

    @property
    def first_us(self) -> int | None:
        """The board's clock where the run's time begins; None before the first piece."""
        return None if self._run is None else self._first_us

    def points(self) -> Points:
        """What came since the last call: t (s since the run began), acc_x, acc_y (m/s²), angle_1, angle_2."""
        new, self._points = self._points, self._points[:0]
        columns = ("t", "acc_x", "acc_y", "angle_1", "angle_2")
        # Hours of seconds keep their hundredths.
        return {name: rounded(new[:, k], 9 if name == "t" else _DIGITS) for k, name in enumerate(columns)}

    def spectrum(self) -> dict[str, Any] | None:
        """Amplitude of acceleration, m/s², on lines `step_hz` apart from 0 to 20 Hz; None before 4 s."""
        if len(self._recent) < SEGMENT:
            return None
        step_hz = self._rate_hz / SEGMENT
        lines = amplitude_spectrum(self._recent)[: int(HIGHEST_HZ / step_hz) + 1]
        return {"step_hz": step_hz, "acc_x": rounded(lines[:, 0]), "acc_y": rounded(lines[:, 1])}

    def _cut(self) -> None:
        self._rest, self._recent = self._rest[:0], self._recent[:0]


def rounded(values: Floats, digits: int = _DIGITS) -> list[float]:
    """For the page: so many digits."""
    return [float(f"{value:.{digits}g}") for value in values]
