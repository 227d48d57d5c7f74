"""Faults of what the board reads: converter at a rail, encoder line broken, main loop that hangs."""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hil_sim.world import Readings

# impid_board.h
ENCODER_FAULT = 0x01
STALLED = 0x08

# By the width of a reading: the 12-bit converter's, the digital sensor's of 20 bits.
HIGHEST_CODE = {np.dtype(np.uint16): 4095, np.dtype(np.uint32): 0xFFFFF}
AXES = {"x": slice(0, 1), "y": slice(1, 2), "both": slice(0, 2)}


class FaultyReadings:
    """Stands between world and board. Nothing is wrong until one of its methods says so."""

    def __init__(self) -> None:
        self._rail: dict[str, Literal["high", "low"]] = {}  # by axis
        self._broken: dict[int, bool] = {}  # encoder (0 or 1) -> its line driver tells the board
        self._last: NDArray[np.int32] | None = None  # what the encoders truly counted
        self._missed = np.zeros(2, dtype=np.int32)  # counts that the board's counters never saw
        self.hanging = False

    def saturate(self, axis: Literal["x", "y", "both"], rail: Literal["high", "low"]) -> None:
        """An input of the converter is driven to a rail."""
        self._rail[axis] = rail

    def release(self, axis: Literal["x", "y", "both"]) -> None:
        """The input follows the sensor again."""
        self._rail.pop(axis, None)

    def break_line(self, encoder: int, *, reported: bool) -> None:
        """A line of encoder 1 or 2 is broken."""
        self._broken[encoder - 1] = reported

    def mend_line(self, encoder: int) -> int:
        """The line is whole; how many counts the counter lacks from now on."""
        self._broken.pop(encoder - 1, None)
        return int(self._missed[encoder - 1])

    def board_restarted(self) -> None:
        """The board's counters start again from zero, wherever the joints are."""
        if self._last is not None:
            self._missed = self._last.copy()

    def __call__(self, readings: Readings) -> tuple[Readings, NDArray[np.uint8]]:
        """What the board reads instead, and the fault bits of each tick, shape (n,)."""
        ticks = len(readings.encoder)
        flags = np.full(ticks, STALLED if self.hanging else 0, dtype=np.uint8)
        adc, encoder = readings.adc, readings.encoder - self._missed
        for axis, rail in self._rail.items():
            adc = adc.copy()
            adc[:, :, AXES[axis]] = HIGHEST_CODE[adc.dtype] if rail == "high" else 0
        for index, reported in self._broken.items():
            if self._last is None:
                self._last = readings.encoder[0].copy()
            stuck = self._last[index] - self._missed[index]
            encoder[:, index] = stuck
            self._missed[index] = readings.encoder[-1, index] - stuck
            if reported:
                flags |= np.uint8(ENCODER_FAULT)
        self._last = readings.encoder[-1].copy()
        return replace(readings, adc=adc, encoder=encoder.astype(np.int32)), flags
