"""How much of the processor's time the binary takes, counted while it runs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil_sim.board.elf.board import ElfBoard
from hil_sim.board.elf.cpu import CPI, ENTRY_CYCLES, EXIT_CYCLES
from hil_sim.board.elf.nvic import FIRST_IRQ

TICK_IRQ = FIRST_IRQ + 56  # DMA2 stream 0: half and whole ring of conversions
TICK_S = 1e-3


@dataclass(frozen=True)
class TickBudget:
    """Instructions of n periods of 1 ms.

    Attributes:
        handler: shape (n,), those of the sampling interrupt, with whatever preempted it.
        whole: shape (n,), all of them, interrupts and main loop, from one tick's conversions to the next.
        exceptions: shape (n,), exceptions entered.
        frequency: the processor's clock, Hz.
    """

    handler: NDArray[np.int64]
    whole: NDArray[np.int64]
    exceptions: NDArray[np.int64]
    frequency: float

    def share(self, instructions: int, exceptions: int) -> float:
        """Part of 1 ms that instructions and the entries and exits of exceptions take, 0 to 1."""
        cycles = instructions * CPI[0] / CPI[1] + exceptions * (ENTRY_CYCLES + EXIT_CYCLES)
        return cycles / (self.frequency * TICK_S)

    @property
    def worst_handler_share(self) -> float:
        """Longest run of the sampling interrupt over 1 ms."""
        return self.share(int(self.handler.max()), 2)

    @property
    def worst_share(self) -> float:
        """Busiest millisecond, everything counted."""
        worst = int(self.whole.argmax())
        return self.share(int(self.whole[worst]), int(self.exceptions[worst]))

    def __str__(self) -> str:
        return (
            f"instructions per 1 kHz tick: interrupt {np.median(self.handler):.0f} typical, "
            f"{self.handler.max()} worst ({100 * self.worst_handler_share:.1f} % of 1 ms); "
            f"with the main loop {np.median(self.whole):.0f} typical, {self.whole.max()} worst "
            f"({100 * self.worst_share:.1f} %) at {self.frequency / 1e6:g} MHz and CPI {CPI[0] / CPI[1]:g}"
        )


class TickCounter:
    """Counts a board's instructions tick by tick: `run` in place of the board's own."""

    def __init__(self, board: ElfBoard) -> None:
        self._board = board
        self._handler = 0
        self._entered_at: int | None = None
        self._exceptions = 0
        self._rows: list[tuple[int, int, int]] = []
        self.start()

    def start(self) -> None:
        """Watches exceptions; a watched chip is somewhat slower."""
        self._board.soc.on_exception = self._on_exception

    def stop(self) -> None:
        """Does not watch them until the next start."""
        self._board.soc.on_exception = None

    def _on_exception(self, exception: int, entering: bool) -> None:
        instructions = int(self._board.soc.clock.instructions)
        self._exceptions += entering
        if exception != TICK_IRQ:
            return
        if entering:
            self._entered_at = instructions
        elif self._entered_at is not None:
            self._handler += instructions - self._entered_at
            self._entered_at = None

    def run(self, adc: NDArray[np.uint16] | NDArray[np.uint32], encoder: NDArray[np.int32]) -> None:
        """Runs one tick per row, as `Board.run`."""
        clock = self._board.soc.clock
        for row in range(len(encoder)):
            before = clock.instructions
            self._handler = self._exceptions = 0
            self._board.run(adc[row : row + 1], encoder[row : row + 1])
            self._rows.append((self._handler, int(clock.instructions - before), self._exceptions))

    def result(self) -> TickBudget:
        """What has been counted so far."""
        handler, whole, exceptions = np.array(self._rows, dtype=np.int64).T
        return TickBudget(handler, whole, exceptions, self._board.soc.schedule.frequency)
