"""The books of runs that a reset or a loss of power ended, against accounts kept by hand."""

import numpy as np
import pytest
from impid_host.clock.device import ClockExchange
from impid_host.recording.ledger import EndedBoot, balance, told_by
from impid_host.recording.runs import Run
from impid_host.samples import DeviceSamples
from impid_host.wire.messages import OPCODE
from impid_host.wire.records import Loss, NewRun, Response, Segment

FIRST_US, START_INDEX, STORED = 2_000_000, 100, 500
LAST_US = FIRST_US + 1000 * (STORED - 1)


def segment(boot_id: int = 7, run: int = 0) -> Segment:
    """500 samples from index 100 on."""
    n = np.arange(STORED)
    zeros = np.zeros(STORED, np.int32)
    samples = DeviceSamples(
        t_us=(FIRST_US + 1000 * n).astype(np.uint64),
        seq=(START_INDEX + n).astype(np.uint32),
        ax=zeros.astype(np.uint16),
        ay=zeros.astype(np.uint16),
        enc1=zeros,
        enc2=zeros,
        flags=zeros.astype(np.uint8),
    )
    return Segment(boot_id, run, (START_INDEX + n).astype(np.uint64), samples)


def started(index: int, boot_id: int = 7) -> Response:
    return Response(boot_id, FIRST_US - 3000, index, 1, OPCODE["START"], 0, index)


def exchange(board_us: int, host_us: float, half_us: int) -> ClockExchange:
    """Half the round trip each way; the board answers at once."""
    return ClockExchange(
        round(1000 * (host_us - half_us)), board_us, board_us, round(1000 * (host_us + half_us))
    )


def ended(produced: int | None, *, half_us: int = 0, off_us: int = 300_000) -> EndedBoot:
    """Boot 7, on the host's clock, dies 4 ms behind its last stored sample; boot 8 begins after off_us."""
    zero_us = LAST_US + 4000 + off_us
    return EndedBoot(
        boot_id=7,
        produced=produced,
        exchanges=(exchange(LAST_US - 50_000, LAST_US - 50_000, half_us),),
        next_exchanges=(exchange(80_000, zero_us + 80_000, half_us),),
    )


def test_what_the_next_boot_still_knows_closes_the_books() -> None:
    (ledger,) = balance(
        [Run.of(segment())],
        [NewRun(7, 0, FIRST_US, False)],
        told_by([]),
        [started(START_INDEX - 3)],
        [ended(3 + STORED + 4)],
    )
    assert (ledger.lost_before, ledger.lost_inside, ledger.lost_after) == (3, 0, 4)
    assert (ledger.produced, ledger.balanced, ledger.uncounted) == (STORED + 7, True, 0)


def test_losses_inside_count_once() -> None:
    events: list[Loss | NewRun] = [NewRun(7, 0, FIRST_US, False), Loss(7, 0, 200, 11)]
    whole = segment()
    gap = Segment(7, 0, whole.index + np.where(whole.index >= 200, 11, 0).astype(np.uint64), whole.samples)
    (ledger,) = balance([Run.of(gap)], events, told_by([]), [started(START_INDEX)], [ended(STORED + 11 + 4)])
    assert (ledger.lost_inside, ledger.lost_after, ledger.balanced) == (11, 4, True)


@pytest.mark.parametrize(("half_us", "off_us"), [(0, 300_000), (200, 300_000), (5000, 20_000)])
def test_after_a_loss_of_power_the_clock_gives_a_bound(half_us: int, off_us: int) -> None:
    """At least what the board can have made, 4 ms of samples less two of the filter; at most the gap, and the
    pings' own uncertainty."""
    (ledger,) = balance(
        [Run.of(segment())],
        [],
        told_by([]),
        [started(START_INDEX)],
        [ended(None, half_us=half_us, off_us=off_us)],
    )
    assert (ledger.produced, ledger.balanced) == (None, None)
    gap_ms = (4000 + off_us + 2 * half_us) / 1000
    assert ledger.uncounted is not None
    assert 2 <= gap_ms - 2 - 1 <= ledger.uncounted <= gap_ms
    assert f"at most {ledger.uncounted} more" in str(ledger)


def test_without_exchanges_on_both_sides_nothing_is_claimed() -> None:
    boot = EndedBoot(7, None, (), ended(None).next_exchanges)
    (ledger,) = balance([Run.of(segment())], [], told_by([]), [started(START_INDEX)], [boot])
    assert ledger.uncounted is None
    assert "the board's own count is not known" in str(ledger)


def test_a_boot_of_which_nothing_came_is_in_the_books_all_the_same() -> None:
    first, silent = balance([Run.of(segment(8))], [], told_by([]), [started(START_INDEX, 8)], [ended(5)])
    assert first.boot_id == 8
    assert (silent.boot_id, silent.run, silent.stored, silent.lost, silent.balanced) == (7, -1, 0, 5, True)
