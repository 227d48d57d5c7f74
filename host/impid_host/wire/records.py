"""What comes out of the wire, whichever carrier brought it."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from impid_host.samples import DeviceSamples, rows_of


@dataclass(frozen=True, slots=True)
class Segment:
    """Samples of one uninterrupted run of one boot; samples may be missing inside, time is never spliced.

    Attributes:
        boot_id: which boot of the board.
        run: counts the segments of a stream: a new boot or a new START opens the next.
        index: sample index unwrapped to 64 bit, shape (N,); a step above 1 is a loss.
        samples: the samples, shape (N,).
    """

    boot_id: int
    run: int
    index: NDArray[np.uint64]
    samples: DeviceSamples

    def __len__(self) -> int:
        return len(self.samples)


@dataclass(frozen=True, slots=True)
class Response:
    """Answer to a command; t_us is the board time of sending, next_index that of the next sample."""

    boot_id: int
    t_us: int
    next_index: int
    request_id: int
    opcode: int
    result: int
    value: int


@dataclass(frozen=True, slots=True)
class Pong:
    """Answer to a PING: t2 when it reached the board, t3 when the answer left, board time in us, 64 bit."""

    boot_id: int
    request_id: int
    t2_us: int
    t3_us: int


@dataclass(frozen=True, slots=True)
class BoardStatus:
    """The board's own counters, all since boot except `produced` and `ring_lost` (since START).

    The fields after next_index are the signals of the STATUS_* messages in their order. t_us is the board
    time of sending, next_index the index of the next sample at that time. Those of STATUS_LOSSES (the resets
    by the converter and by DMA: since power-on) are None where the board does not count them.
    """

    boot_id: int
    t_us: int
    next_index: int
    produced: int
    ring_lost: int
    frames_sent: int
    frames_dropped: int
    late: int
    overruns: int
    saturated: int
    encoder_faults: int
    accepted: int
    rejected: int
    state: int
    reset_cause: int
    clock_source: int
    self_test: int
    supply_mV: int
    worst_tick_us: int
    bus_off: int
    tx_errors: int
    rx_errors: int
    uptime_s: int
    line_errors: int | None = None
    can_overruns: int | None = None
    adc_overruns: int | None = None
    dma_errors: int | None = None


@dataclass(frozen=True, slots=True)
class Loss:
    """`lost` samples are missing from index `first_index` (64 bit) on, within one run."""

    boot_id: int
    run: int
    first_index: int
    lost: int


@dataclass(frozen=True, slots=True)
class NewRun:
    """The stream began anew at board time t_us: another boot, or another START of the same boot.

    `start_index` is the first index as the START just before it named it, where the carrier tells (CAN, whose
    answers carry no boot).
    """

    boot_id: int
    run: int
    t_us: int
    reboot: bool
    start_index: int | None = None


@dataclass(frozen=True, slots=True)
class Decoded:
    """Everything that one piece of the stream contained."""

    segments: tuple[Segment, ...] = ()
    statuses: Sequence[BoardStatus] = ()
    responses: tuple[Response, ...] = ()
    pongs: tuple[Pong, ...] = ()
    events: tuple[Loss | NewRun, ...] = ()


def join_samples(parts: list[DeviceSamples]) -> DeviceSamples:
    """Parts of one sensor one after the other; at least one."""
    there = [f.name for f in fields(DeviceSamples) if getattr(parts[0], f.name) is not None]
    return DeviceSamples(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in there})


def join_segments(pieces: list[Segment]) -> tuple[Segment, ...]:
    """Pieces of the same run, which follow each other, become one segment."""
    joined = []
    for run, group in groupby(pieces, key=lambda piece: piece.run):
        parts = list(group)
        joined.append(
            Segment(
                boot_id=parts[0].boot_id,
                run=run,
                index=np.concatenate([part.index for part in parts]),
                samples=join_samples([part.samples for part in parts]),
            )
        )
    return tuple(joined)


def until(segment: Segment, end: tuple[int, int] | None) -> Segment | None:
    """What of a segment belongs to a recording that ends in some run with some stamp (us); None: nothing."""
    if end is None or segment.run < end[0]:
        return segment
    count = int(np.searchsorted(segment.samples.t_us, end[1], side="right")) if segment.run == end[0] else 0
    if count == 0:
        return None
    return _part(segment, slice(0, count))


def since(segment: Segment, begin: tuple[int, int] | None) -> Segment | None:
    """What of a segment belongs to a window that begins in some run with some stamp (us); None: nothing."""
    if begin is None or segment.run > begin[0]:
        return segment
    first = int(np.searchsorted(segment.samples.t_us, begin[1])) if segment.run == begin[0] else len(segment)
    if first == len(segment):
        return None
    return _part(segment, slice(first, None))


def _part(segment: Segment, kept: slice) -> Segment:
    return Segment(segment.boot_id, segment.run, segment.index[kept], rows_of(segment.samples, kept))
