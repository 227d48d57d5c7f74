"""The whole bench test, in an order in which no part spoils the next."""

from collections.abc import Callable, Iterator

from impid_host.bring_up import clocks, converter, recovery, wire
from impid_host.bring_up.board import BenchBoard
from impid_host.bring_up.result import Result, not_measured
from impid_host.link.link import Link
from impid_host.wire.records import BoardStatus

LOOP_FRAMES = 200
TICK_BUDGET_US = 250.0


def bring_up(
    board: BenchBoard, operator: wire.Operator, reopen: Callable[[], Link], minutes: float
) -> Iterator[Result]:
    """Results one by one, as they come.

    Raises:
        LinkError: the board has no bench test, falls silent, or refuses.
    """
    before = board.client.status()
    yield from clocks.external_clock(board)
    yield converter.supply(board)
    yield loopback(board)
    yield from converter.reference_noise(board)
    yield from converter.accelerometer(board)
    if operator.bare():
        yield from (wire.quadrature(board, encoder) for encoder in (1, 2))
        yield from wire.latch_instants(board, operator)
    else:
        yield not_measured("quadrature, latch skew", "something is wired to the inputs that the test drives")
    yield from clocks.drift(board, minutes)
    yield from counters(board, before)
    yield from recovery.watchdog(board)
    yield recovery.cut_saves(board)
    yield recovery.unplugged(board, operator, reopen)


def loopback(board: BenchBoard) -> Result:
    """The CAN controller hears itself: queue, mailbox, filter, FIFO, interrupts; not the pins."""
    back = board.loopback(LOOP_FRAMES)
    return Result(
        "CAN frames that the controller hears from itself",
        float(back),
        "",
        LOOP_FRAMES,
        LOOP_FRAMES,
        "loopback and silent: the pins take no part",
        "a controller with its own errata; pins and transceiver only on a bus",
    )


COUNTERS = (
    "late",
    "overruns",
    "ring_lost",
    "frames_dropped",
    "line_errors",
    "can_overruns",
    "adc_overruns",
    "dma_errors",
)


def counters(board: BenchBoard, before: BoardStatus) -> Iterator[Result]:
    """What the board counted since `before`, nothing of which belongs there."""
    status = board.client.status()
    yield Result(
        "longest run of the sampling interrupt",
        float(status.worst_tick_us),
        "us",
        0.0,
        TICK_BUDGET_US,
        "of a period of 1000",
        "the cycles of pipeline and flash; the emulator assumes 1.5 an instruction",
    )
    for name in COUNTERS:
        now, then = getattr(status, name), getattr(before, name)
        yield (
            not_measured(f"counter {name}", "the board does not count it")
            if now is None or then is None
            else Result(f"counter {name}", float(now - then), "", 0.0, 0.0)
        )
