"""What the simulator asks of a board, whatever runs it: the native core, or the shipping binary."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Board(Protocol):
    """A sensor board that a caller drives tick by tick (1 ms each, board time)."""

    @property
    def now_us(self) -> int:
        """The board's clock, microseconds since its boot."""

    @property
    def next_tick_us(self) -> int:
        """Board time of the next tick that `run` will run."""

    @property
    def streaming(self) -> bool | None:
        """Samples leave on some carrier; None where it cannot be told."""

    @property
    def self_test_pin(self) -> bool:
        """The accelerometer's self-test input is driven."""

    @property
    def reset_requested(self) -> bool:
        """The board asked to be reset: discard it and make a new one."""

    def run(
        self,
        adc: NDArray[np.uint16] | NDArray[np.uint32],
        encoder: NDArray[np.int32],
        faults: NDArray[np.uint8] | None = None,
    ) -> None:
        """Runs one tick per row.

        adc: (n, 8, 2) codes, of a digital sensor (n, 1, 3); encoder: (n, 2) counts; faults: (n,) bits.
        """

    @property
    def lines_idle_us(self) -> int:
        """Board time at which all that now waits will have left the board; now_us where it cannot be told."""

    def advance(self, t_us: int) -> None:
        """Lets the lines carry on until board time t_us, between ticks, where the board can."""

    def can_bus_off(self) -> None:
        """The CAN controller has seen too many errors and leaves the bus."""

    def serial_receive(self, data: bytes, t_us: int) -> None:
        """Bytes that arrived at board time t_us."""

    def serial_take(self) -> bytes:
        """Bytes that the board has sent since the last call."""

    def can_receive(self, identifier: int, data: bytes, t_us: int) -> None:
        """A classic frame that arrived at board time t_us."""

    def can_take(self) -> list[tuple[int, bytes]]:
        """Identifier and data of the frames that the board has sent since the last call."""

    def close(self) -> None:
        """Gives back what the board holds."""
