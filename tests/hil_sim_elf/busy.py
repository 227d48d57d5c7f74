"""The busiest millisecond there is: a batch, a STATUS that is due and one that is asked for fall together."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hil_sim.board.elf.board import ElfBoard
from hil_sim.board.elf.budget import TickCounter
from hil_sim.board.wire import FrameReader, accepts_start, command

BATCH_TICKS = 10
STATUS_TICKS = 100
AROUND = 15  # ticks about a STATUS that is due

Readings = Callable[[int, int, int], tuple[NDArray[np.uint32] | NDArray[np.uint16], NDArray[np.int32]]]


def busiest_share(boot: Callable[[], ElfBoard], readings: Readings) -> float:
    """Part of a millisecond, 0 to 1: the worst over all places of the batch against the STATUS."""
    return max(_with_batch_at(boot(), readings, 3 + phase) for phase in range(BATCH_TICKS))


def _with_batch_at(board: ElfBoard, readings: Readings, ticks: int) -> float:
    board.run(*readings(ticks, 3, 0))
    board.serial_receive(command(1, "START"), board.next_tick_us - 450)
    counter = TickCounter(board)
    sent = b""
    adc, encoder = readings(2 * STATUS_TICKS + AROUND - ticks, 3, ticks)
    for row in range(len(encoder)):
        if row > AROUND and (row + ticks + AROUND) % STATUS_TICKS < 2 * AROUND:
            board.serial_receive(command(row, "STATUS"), board.next_tick_us - 100)
        counter.run(adc[row : row + 1], encoder[row : row + 1])
        sent += board.serial_take()
    assert any(accepts_start(frame) for frame in FrameReader().feed(sent))
    return counter.result().worst_share
