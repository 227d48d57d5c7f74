"""Puts groups of samples in order: which run they belong to, what is missing between them.

A group is what arrives together: a batch on serial, one sample on CAN. It carries the boot, the 32-bit index
and the board time of its first sample. Within a run, index and time advance together; the next group
is then a continuation, with or without a gap. Where they disagree the stream has begun anew. A group
older than what is already there is an echo and is dropped.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from impid_host.wire.messages import SAMPLE_PERIOD_US
from impid_host.wire.records import Loss, NewRun

_MASK32 = 0xFFFFFFFF


@dataclass(frozen=True, slots=True)
class Groups:
    """Groups in order of arrival, each array of shape (N,); t0_us and first_index belong to sample 0."""

    boot_id: NDArray[np.uint16]
    first_index: NDArray[np.uint32]
    t0_us: NDArray[np.uint64]
    count: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.count)


@dataclass(frozen=True, slots=True)
class Position:
    """The sample expected next: boot, run, index (64 bit) and stamp (us)."""

    boot_id: int
    run: int
    index: int
    t_us: int


@dataclass(frozen=True, slots=True)
class Span:
    """Groups start..stop-1 follow each other without a gap; first_index is 64 bit."""

    start: int
    stop: int
    boot_id: int
    run: int
    first_index: int


@dataclass(slots=True)
class SampleCounts:
    """Samples accepted, samples missing inside runs, and groups dropped because they were there already."""

    stored: int = 0
    lost: int = 0
    stale_groups: int = 0


@dataclass(slots=True)
class Tracker:
    """State of the stream between two pieces of it."""

    counts: SampleCounts = field(default_factory=SampleCounts)
    boot_id: int | None = None
    run: int = -1
    _next_index: int = 0
    _next_t_us: int = 0

    def resume(self, position: Position) -> None:
        """Begin in the middle of a stream, of which this sample comes next."""
        self.boot_id, self.run = position.boot_id, position.run
        self._next_index, self._next_t_us = position.index, position.t_us

    @property
    def expected(self) -> Position | None:
        """The sample expected next; None before the first."""
        if self.boot_id is None:
            return None
        return Position(self.boot_id, self.run, self._next_index, self._next_t_us)

    def go_on(self, samples: int, next_t_us: int) -> None:
        """So many came that follow without a gap."""
        self.counts.stored += samples
        self._next_index += samples
        self._next_t_us = next_t_us

    def place(self, groups: Groups) -> tuple[list[Span], list[Loss | NewRun]]:
        """Spans of the groups that are new, and what happened between them."""
        spans: list[Span] = []
        events: list[Loss | NewRun] = []
        if not len(groups):
            return spans, events
        breaks = np.flatnonzero(~_continues(groups))
        for start, stop in zip(breaks.tolist(), [*breaks[1:].tolist(), len(groups)], strict=True):
            fresh = self._first_fresh(groups, start, stop)
            self.counts.stale_groups += fresh - start
            if fresh < stop:
                spans.append(self._append(groups, fresh, stop, events))
        return spans, events

    def _first_fresh(self, groups: Groups, start: int, stop: int) -> int:
        if int(groups.boot_id[start]) != self.boot_id:
            return start
        return start + int(np.count_nonzero(groups.t0_us[start:stop] < np.uint64(self._next_t_us)))

    def _append(self, groups: Groups, start: int, stop: int, events: list[Loss | NewRun]) -> Span:
        boot_id, index = int(groups.boot_id[start]), int(groups.first_index[start])
        t_us, samples = int(groups.t0_us[start]), int(groups.count[start:stop].sum(dtype=np.int64))
        gap = (index - self._next_index) & _MASK32
        late_us = t_us - self._next_t_us
        if boot_id == self.boot_id and abs(late_us - gap * SAMPLE_PERIOD_US) < SAMPLE_PERIOD_US // 2:
            index = self._next_index + gap
            if gap:
                events.append(Loss(boot_id=boot_id, run=self.run, first_index=self._next_index, lost=gap))
                self.counts.lost += gap
        else:
            reboot = self.boot_id is not None and boot_id != self.boot_id
            self.boot_id, self.run = boot_id, self.run + 1
            events.append(NewRun(boot_id=boot_id, run=self.run, t_us=t_us, reboot=reboot))
        self.counts.stored += samples
        self._next_index = index + samples
        self._next_t_us = int(groups.t0_us[stop - 1]) + int(groups.count[stop - 1]) * SAMPLE_PERIOD_US
        return Span(start=start, stop=stop, boot_id=boot_id, run=self.run, first_index=index)


def _continues(groups: Groups) -> NDArray[np.bool_]:
    """True where a group follows exactly on the one before it; False for the first."""
    same = np.zeros(len(groups), dtype=np.bool_)
    count = groups.count[:-1]
    same[1:] = (
        (groups.boot_id[1:] == groups.boot_id[:-1])
        & (groups.first_index[1:] == groups.first_index[:-1] + count.astype(np.uint32))
        & (groups.t0_us[1:] == groups.t0_us[:-1] + count.astype(np.uint64) * np.uint64(SAMPLE_PERIOD_US))
    )
    return same
