"""The books of a recording: what the board produced against what is stored and what is counted as lost."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import floor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impid_host.clock.device import ClockExchange
from impid_host.recording.runs import Run
from impid_host.wire.messages import OPCODE, RESULT, SAMPLE_PERIOD_US
from impid_host.wire.records import BoardStatus, Loss, NewRun, Response
from impid_host.wire.statuses import Statuses

_MASK32 = 0xFFFFFFFF
# Two crystals of a cheap board and a PC, in the worst case.
_WORST_DRIFT = 500e-6
_FILTER_TICKS = 2  # a sample is complete two ticks after its instant


@dataclass(frozen=True, slots=True)
class EndedBoot:
    """A boot that a reset ended.

    Attributes:
        boot_id: which.
        produced: samples since its last START, as the board still knew after the reset; None: it did not.
        exchanges, next_exchanges: clock exchanges of this boot and of the one that followed.
        nominal_rate: board seconds in a host second.
    """

    boot_id: int
    produced: int | None
    exchanges: Sequence[ClockExchange]
    next_exchanges: Sequence[ClockExchange]
    nominal_rate: float = 1.0


@dataclass(frozen=True, slots=True)
class RunLedger:
    """One run of one boot.

    Attributes:
        boot_id, run: which; run is -1 where no sample of it came.
        stored: samples in the recording.
        surplus: samples among its raw bytes that came after the duration asked for.
        lost_before: missing between START and the first stored sample; None where START was not recorded.
        lost_inside: missing between stored samples, counted by the index.
        lost_after: missing behind the last stored sample, as the board told; None where it told nothing.
        produced: the board's own count since START, taken last; None where none followed.
        uncounted: where a loss of power took the board's count: how many samples at most it had made behind
            the last stored one; None where that cannot be said either, 0 where everything is counted.
    """

    boot_id: int
    run: int
    stored: int
    lost_before: int | None
    lost_inside: int
    lost_after: int | None
    produced: int | None
    uncounted: int | None = 0
    surplus: int = 0

    @property
    def lost(self) -> int:
        """Samples known to be lost."""
        return (self.lost_before or 0) + self.lost_inside + (self.lost_after or 0)

    @property
    def balanced(self) -> bool | None:
        """Whether produced = stored + lost + surplus, exactly; None where the board's count is not known."""
        return None if self.produced is None else self.produced == self.stored + self.lost + self.surplus

    def __str__(self) -> str:
        if self.produced is None:
            rest = "" if self.uncounted is None else f", and at most {self.uncounted} more"
            return f"{self.stored} samples stored, {self.lost} lost{rest}; the board's own count is not known"
        sign = "=" if self.balanced else "IS NOT"
        after = f" + {self.surplus} after the end" if self.surplus else ""
        parts = f"{self.stored} stored + {self.lost} lost{after}"
        return f"{self.produced} samples produced by the board {sign} {parts}"


# The board's own count at one moment.
TOLD = np.dtype([("boot_id", "<u2"), ("t_us", "<u8"), ("next_index", "<u4"), ("produced", "<u4")])


def told_by(statuses: Iterable[BoardStatus]) -> NDArray[Any]:
    """What statuses say of the samples produced, shape (N,) of TOLD."""
    if isinstance(statuses, Statuses):
        told = np.zeros(len(statuses), TOLD)
        for name, column in zip(TOLD.names or (), statuses.told(), strict=True):
            told[name] = column
        return told
    return np.array([(s.boot_id, s.t_us, s.next_index, s.produced) for s in statuses], dtype=TOLD)


def balance(
    runs: Iterable[Run],
    events: Iterable[Loss | NewRun],
    told: NDArray[Any],
    responses: Iterable[Response],
    ended: Sequence[EndedBoot] = (),
) -> tuple[RunLedger, ...]:
    """The ledger of every run, from what the wire brought and what is known of the boots that ended."""
    runs, events = list(runs), list(events)
    losses = [event for event in events if isinstance(event, Loss)]
    named = {event.run: event.start_index for event in events if isinstance(event, NewRun)}
    responses = list(responses)
    counts = _counts_told(told, responses)
    ledgers = []
    for run in runs:
        later = [other.first_us for other in runs if other.boot_id == run.boot_id and other.run > run.run]
        start = named.get(run.run)
        if start is None:
            start = _start_of(responses, run.boot_id, run.first_us)
        last = _last_told(counts, run, min(later, default=None))
        end = None if later else next((boot for boot in ended if boot.boot_id == run.boot_id), None)
        if end is not None and end.produced is not None and start is not None:
            last = _Told((start + end.produced) & _MASK32, end.produced)
        elif end is not None:
            last = None  # what it said while it lived is not the whole
        surplus = run.arrived - run.stored
        ledgers.append(
            RunLedger(
                boot_id=run.boot_id,
                run=run.run,
                stored=run.stored,
                surplus=surplus,
                lost_before=None if start is None else _ahead(run.first_index, start),
                lost_inside=sum(loss.lost for loss in losses if loss.run == run.run),
                lost_after=None if last is None else _ahead(last.next_index, run.last_index + 1),
                produced=None if last is None else last.produced,
                uncounted=0 if last is not None else _at_most(end, run.last_us),
            )
        )
    heard = {run.boot_id for run in runs}
    silent = [boot for boot in ended if boot.boot_id not in heard and boot.produced]
    ledgers += [RunLedger(boot.boot_id, -1, 0, 0, 0, boot.produced, boot.produced) for boot in silent]
    return tuple(ledgers)


def _at_most(end: EndedBoot | None, last_us: int) -> int | None:
    """How many samples a boot can have made behind its last stored one, by the clock.

    The board's answer to a ping was between the host's two stamps, so the last sample was not before the
    first of them says, and the zero of the next boot, when this one was over, not after the second says.
    """
    if end is None or not end.exchanges or not end.next_exchanges:
        return None
    ns = 1000 / end.nominal_rate  # of the host in a microsecond of the board
    since_us = [last_us - e.t2_us for e in end.exchanges]
    last_ns = max(
        e.t1_ns + ns * (us - _WORST_DRIFT * abs(us)) for e, us in zip(end.exchanges, since_us, strict=True)
    )
    over_ns = min(e.t4_ns - ns * e.t3_us * (1 - _WORST_DRIFT) for e in end.next_exchanges)
    return max(0, floor((over_ns - last_ns) / (ns * SAMPLE_PERIOD_US)) - _FILTER_TICKS)


@dataclass(frozen=True, slots=True)
class _Told:
    """Index of the next sample and samples produced, as the board counts them."""

    next_index: int
    produced: int


def _counts_told(told: NDArray[Any], responses: list[Response]) -> NDArray[Any]:
    """From statuses and from the answers to STOP, whose value is the same count; in order of time."""
    stops = [
        (r.boot_id, r.t_us, r.next_index, r.value)
        for r in responses
        if r.opcode == OPCODE["STOP"] and r.result == RESULT["OK"]
    ]
    both = np.concatenate([told, np.array(stops, dtype=TOLD)])
    return both[np.argsort(both["t_us"], kind="stable")]


def _last_told(counts: NDArray[Any], run: Run, until_us: int | None) -> _Told | None:
    """The last count of the run's boot behind its samples and before those of the next."""
    # Made before the last samples left: its next index is not behind theirs.
    ahead = (counts["next_index"].astype(np.int64) - run.last_index - 1) & _MASK32
    fits = (counts["boot_id"] == run.boot_id) & (counts["t_us"] >= run.last_us) & (ahead < 1 << 31)
    if until_us is not None:
        fits &= counts["t_us"] < until_us
    found = np.flatnonzero(fits)
    if not len(found):
        return None
    last = counts[found[-1]]
    return _Told(int(last["next_index"]), int(last["produced"]))


def _start_of(responses: list[Response], boot_id: int, first_us: int) -> int | None:
    """The index of a run's first sample, as the answer to its START named it."""
    accepted = (r for r in responses if r.opcode == OPCODE["START"] and r.result == RESULT["OK"])
    found = [r for r in accepted if r.boot_id == boot_id and r.t_us <= first_us + _START_SLACK_US]
    return found[-1].value if found else None


# The answer may have had to be repeated while samples came already.
_START_SLACK_US = 2_000_000


def _ahead(later: int, earlier: int) -> int:
    """How far one 32-bit index is ahead of another; 0 when it is behind."""
    ahead = (later - earlier) & _MASK32
    return ahead if ahead < 1 << 31 else 0
