"""Order, gaps, wraps and restarts, from groups written down by hand."""

import numpy as np
from impid_host.wire.records import Loss, NewRun
from impid_host.wire.tracker import Groups, Tracker


def groups(*rows: tuple[int, int, int, int]) -> Groups:
    """From (boot_id, first_index, t0_us, count)."""
    boot, first, t0, count = zip(*rows, strict=True)
    return Groups(
        np.array(boot, np.uint16),
        np.array(first, np.uint32),
        np.array(t0, np.uint64),
        np.array(count, np.uint8),
    )


def test_index_wraps_at_32_bit() -> None:
    tracker = Tracker()
    spans, _ = tracker.place(groups((1, 2**32 - 10, 0, 10), (1, 0, 10_000, 10)))
    assert [(s.first_index, s.stop - s.start) for s in spans] == [(2**32 - 10, 2)]
    spans, events = tracker.place(groups((1, 15, 25_000, 10)))
    assert spans[0].first_index == 2**32 + 15
    assert events == [Loss(boot_id=1, run=0, first_index=2**32 + 10, lost=5)]
    assert tracker.counts.lost == 5


def test_a_second_start_is_a_new_run_without_loss() -> None:
    tracker = Tracker()
    tracker.place(groups((1, 0, 0, 10)))
    spans, events = tracker.place(groups((1, 0, 900_000, 10)))
    assert events == [NewRun(boot_id=1, run=1, t_us=900_000, reboot=False)]
    assert (spans[0].run, tracker.counts.lost, tracker.counts.stored) == (1, 0, 20)


def test_a_start_that_carries_the_index_on_is_a_new_run_too() -> None:
    tracker = Tracker()
    tracker.place(groups((1, 0, 0, 10)))
    _, events = tracker.place(groups((1, 10, 900_000, 10)))
    assert [type(e) for e in events] == [NewRun]
    assert tracker.counts.lost == 0


def test_a_reboot_is_marked() -> None:
    tracker = Tracker()
    _, events = tracker.place(groups((1, 0, 0, 10), (2, 0, 3000, 10), (2, 10, 13_000, 10)))
    assert events == [
        NewRun(boot_id=1, run=0, t_us=0, reboot=False),
        NewRun(boot_id=2, run=1, t_us=3000, reboot=True),
    ]
    assert tracker.counts.stored == 30


def test_only_the_new_part_of_an_echo_is_taken() -> None:
    tracker = Tracker()
    tracker.place(groups((1, 0, 0, 10), (1, 10, 10_000, 10)))
    spans, events = tracker.place(groups((1, 10, 10_000, 10), (1, 20, 20_000, 10)))
    assert [(s.start, s.stop, s.first_index) for s in spans] == [(1, 2, 20)]
    assert events == []
    assert tracker.counts.stale_groups == 1


def test_nothing() -> None:
    assert Tracker().place(groups((1, 0, 0, 10)))[0]
    empty = Groups(
        np.zeros(0, np.uint16), np.zeros(0, np.uint32), np.zeros(0, np.uint64), np.zeros(0, np.uint8)
    )
    assert Tracker().place(empty) == ([], [])
