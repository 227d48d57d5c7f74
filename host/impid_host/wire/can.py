"""CAN frames to samples, statuses and answers: the same records as from the serial line.

A sample is an ACCEL and an ENCODER frame; each carries low bits of the sample index, so a lost half is seen
and never paired with a neighbour. Of a wide sensor an ACCEL_FINE comes before them; a sample that lacks its
own is none. The instant comes from the latest TIME and EPOCH pair, which the board sends just before the
sample that it dates. After a START or a reset nothing is dated until the next pair: a sample without a date
is not used, because a guess could splice two boots.

The bus carries no time of sending for statuses and answers; theirs is that of the latest sample.
"""

from dataclasses import astuple, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impid_host.samples import DeviceSamples
from impid_host.wire import native_can
from impid_host.wire.can_dates import MASK32, UNDATED, Date, Placed, date_of, forget_at_resets
from impid_host.wire.can_statuses import STATUS_ALWAYS, STATUS_LAST, RegularSets, regular_sets
from impid_host.wire.decoder import LinkCounts, device_samples
from impid_host.wire.messages import (
    ACCEL,
    ACCEL_FINE,
    ENCODER,
    EPOCH,
    FLAG_FINE,
    HEADER,
    OPCODE,
    PONG,
    PROTOCOL_VERSION,
    RESPONSE,
    RESULT,
    SAMPLE_PERIOD_US,
    STATUS,
    TIME,
    Words,
)
from impid_host.wire.native_can import PAIR_NS
from impid_host.wire.records import Decoded, Loss, NewRun, Pong, Response, Segment
from impid_host.wire.statuses import Statuses, scalars
from impid_host.wire.tracker import Groups, Position, Tracker

_DATING = (TIME.frame_id, EPOCH.frame_id, RESPONSE.frame_id)
_ANSWERS = {layout.frame_id: layout for layout in (*STATUS, RESPONSE, PONG)}
_DATA = (ACCEL.frame_id, ENCODER.frame_id, ACCEL_FINE.frame_id)
_BEHIND_ALL = 1 << 62
# The index bits of a second half repeat after 256 ms: what lies further apart needs a witness, whose own bits
# repeat after 65 s.
_STALL_NS = 30_000_000_000


@dataclass(frozen=True, slots=True)
class _Halves:
    """Frames of N samples: ACCEL, ENCODER and ACCEL_FINE (0: it has none), shape (N, 3), and where in the
    piece the ACCEL of each stood."""

    words: Words
    position: NDArray[np.intp]


@dataclass(slots=True)
class CanDecoder:
    """Decoder of one bus; feed it frames in order of arrival."""

    _tracker: Tracker = field(default_factory=Tracker)
    _good: int = 0
    _unpaired: int = 0
    _undated: int = 0
    _waiting: Words = field(default_factory=lambda: np.zeros(0, np.uint64))  # a first half, or a late pair
    _waiting_ns: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))  # their arrival
    _fine: Words = field(default_factory=lambda: np.zeros(0, np.uint64))  # the last ones, of those that wait
    _time: int | None = None  # a TIME that waits for its EPOCH
    _date: Date | None = None
    _date_used: bool = False
    _last: tuple[int, int, int] = (0, 0, 0)  # boot_id, t_us, next index of the latest sample
    _samples_of_piece: Placed = field(default_factory=Placed.none)
    _start_index: int | None = None
    _open_start: list[tuple[int, int]] = field(default_factory=list)  # position -1, value of the last START
    _status: dict[int, int] = field(default_factory=dict)

    @property
    def counts(self) -> LinkCounts:
        """Totals so far; bad frames are halves without the other, inconsistent are samples without a date."""
        samples = astuple(self._tracker.counts)
        return LinkCounts(self._good, self._unpaired, 0, 0, self._undated, *samples)

    def resume(self, position: Position) -> None:
        """Begin in the middle of a stream, of which this sample comes next."""
        self._tracker.resume(position)

    def feed(
        self, identifiers: NDArray[np.uint16], words: Words, arrival_ns: NDArray[np.int64] | None = None
    ) -> Decoded:
        """What the frames complete: identifiers and payloads (one little-endian word each), shape (N,).

        Two halves whose arrivals are 200 ms apart (frames were lost, or the program that read them stood
        still) are one sample only if the next sample's first half follows: the few index bits of a second
        half repeat after 256 ms. Frames of other identifiers, which other devices may send, are passed over.
        """
        arrival_ns = np.zeros(len(words), np.int64) if arrival_ns is None else arrival_ns
        halves = self._pair(identifiers, words, arrival_ns)
        is_data = np.isin(identifiers, _DATA)
        dates: list[Date | None] = [self._date and Date(-1, *astuple(self._date)[1:])]
        breaks: list[int] = []
        starts: list[tuple[int, int]] = []
        others = np.flatnonzero(~is_data)
        for at in others[np.isin(identifiers[others], _DATING)].tolist():
            identifier, word = int(identifiers[at]), int(words[at])
            if identifier == TIME.frame_id:
                self._time = word
            elif identifier == EPOCH.frame_id:
                dates += self._epoch(at, scalars(EPOCH, word))
            elif identifier == RESPONSE.frame_id and _starts(scalars(RESPONSE, word)):
                breaks.append(at)
                starts.append((at, scalars(RESPONSE, word)["value"]))
        known = [date for date in dates if date is not None]
        segments, events = self._place(halves, known, breaks, [*self._open_start, *starts])
        self._open_start = [(-1, value) for _, value in (*self._open_start, *starts)[-1:]]
        answers = self._answers(others, identifiers[others], words[others])
        return Decoded(tuple(segments), *answers, tuple(events))

    def follow(self, frames: NDArray[np.void]) -> Decoded | None:
        """What CAN_FRAMEs (N,) complete, in one pass in C, where all goes on from where the bus stands; None:
        not so, nothing was taken."""
        stands, date = self._tracker.expected, self._date
        if stands is None or date is None or date.boot_id != stands.boot_id or len(self._waiting) > 1:
            return None
        half = bool(len(self._waiting))
        found = native_can.follow(
            frames,
            index=stands.index,
            t_us=stands.t_us,
            boot=stands.boot_id,
            date_us=date.t_us,
            date_index=date.index,
            has_accel=half,
            accel=int(self._waiting[0]) if half else 0,
            accel_ns=int(self._waiting_ns[0]) if half else 0,
            accel_at=-1,
            has_time=self._time is not None,
            time=self._time or 0,
        )
        if found is None:
            return None
        self._go_on(found, stands)
        others = frames[found.others]
        words = np.frombuffer(others["data"].tobytes(), "<u8")
        segments: tuple[Segment, ...] = ()
        if len(found.at):
            samples = DeviceSamples(**found.samples)
            segments = (Segment(stands.boot_id, stands.run, found.numbers, samples),)
        return Decoded(segments, *self._answers(found.others, others["identifier"], words))

    def _go_on(self, found: native_can.Followed, stands: Position) -> None:
        """Stand behind what was found."""
        bus, count = found.bus, len(found.at)
        self._good += bus.good
        self._time = bus.time if bus.has_time else None
        self._waiting = np.full(bus.has_accel, bus.accel, np.uint64)
        self._waiting_ns = np.full(bus.has_accel, bus.accel_ns, np.int64)
        if bus.dated:
            self._date = Date(-1, stands.boot_id, bus.date_index, bus.date_us)
        if bus.dated or count:
            self._date_used = bool(count) and not bus.date_unused
        self._tracker.go_on(count, bus.t_us)
        boots = np.full(count, stands.boot_id, np.uint16)
        self._samples_of_piece = Placed(
            found.at, boots, found.samples["t_us"], found.samples["seq"], self._last
        )
        self._last = self._samples_of_piece.latest(_BEHIND_ALL)

    def _pair(self, identifiers: NDArray[np.uint16], words: Words, arrival_ns: NDArray[np.int64]) -> _Halves:
        at = np.flatnonzero((identifiers == ACCEL.frame_id) | (identifiers == ENCODER.frame_id))
        waiting = len(self._waiting)
        word = np.concatenate([self._waiting, words[at].astype(np.uint64)])
        came_ns = np.concatenate([self._waiting_ns, arrival_ns[at]])
        position = np.concatenate([np.full(waiting, -1, dtype=np.intp), at])
        first = np.concatenate(
            [np.arange(waiting) % 2 == 0, identifiers[at] == ACCEL.frame_id]  # a late pair begins with one
        )
        pair = np.flatnonzero(first[:-1] & ~first[1:])
        index = ACCEL.unpack(word[pair])["index_low16"]
        pair = pair[(index & np.uint64(0xFF)) == ENCODER.unpack(word[pair + 1])["index_low8"]]
        apart_ns = came_ns[pair + 1] - came_ns[pair]
        late = apart_ns >= PAIR_NS
        unwitnessed = bool(len(pair)) and bool(late[-1]) and int(pair[-1]) + 2 == len(word)
        pair = pair[~late | ((apart_ns < _STALL_NS) & _followed(pair, word, first))]
        keep = 2 if unwitnessed else int(len(word) > 0 and bool(first[-1]))
        self._waiting, self._waiting_ns = word[len(word) - keep :], came_ns[len(word) - keep :]
        fine, asked, found = self._fine_of(identifiers, words, word[pair], position[pair])
        whole = ~asked | found
        pair, fine = pair[whole], fine[whole]
        self._good += 2 * len(pair) + int(np.count_nonzero(found))
        self._unpaired += len(word) - keep - 2 * len(pair)
        return _Halves(np.column_stack([word[pair], word[pair + 1], fine]), position[pair])

    def _fine_of(
        self, identifiers: NDArray[np.uint16], words: Words, accel: Words, position: NDArray[np.intp]
    ) -> tuple[Words, NDArray[np.bool_], NDArray[np.bool_]]:
        """The ACCEL_FINE of each ACCEL (else 0), which of them ask for one, and for which it was there."""
        at = np.flatnonzero(identifiers == ACCEL_FINE.frame_id)
        fine = np.concatenate([self._fine, words[at].astype(np.uint64)])
        place = np.concatenate([np.full(len(self._fine), -1, dtype=np.intp), at])
        self._fine = fine[max(len(fine) - 2, 0) :]
        signals = ACCEL.unpack(accel)
        asked = (signals["flags"] & np.uint64(FLAG_FINE)) != 0
        # The latest before the ACCEL; of a pair that waited, the next sample's may have come since.
        latest = np.searchsorted(place, position, side="right") + 1
        fine = np.concatenate([np.zeros(2, np.uint64), fine])
        low16 = ACCEL_FINE.unpack(fine)["index_low16"].astype(np.int64)
        low16[:2] = -1
        wanted = signals["index_low16"].astype(np.int64)
        chosen = np.where(low16[latest] == wanted, latest, latest - 1)
        found = asked & (low16[chosen] == wanted)
        return np.where(found, fine[chosen], np.uint64(0)), asked, found

    def _epoch(self, at: int, epoch: dict[str, int]) -> list[Date]:
        word, self._time = self._time, None
        if word is None:
            return []
        time = scalars(TIME, word)
        if time["index_low16"] != epoch["index"] & 0xFFFF or epoch["version"] != PROTOCOL_VERSION:
            return []
        self._good += 2
        self._date = Date(at, epoch["boot_id"], epoch["index"], time["t_us"])
        return [self._date]

    def _place(
        self, halves: _Halves, dates: list[Date], breaks: list[int], starts: list[tuple[int, int]]
    ) -> tuple[list[Segment], list[Loss | NewRun]]:
        accel = ACCEL.unpack(halves.words[:, 0])
        which = date_of(halves.position, dates, breaks)
        forget_at_resets(which, accel["flags"].astype(np.uint8), dates, used=self._date_used)
        if len(which) or len(dates) > 1:
            self._date_used = bool(len(which)) and which[-1] == len(dates) - 1
        if breaks and (not dates or dates[-1].position < breaks[-1]):
            self._date = None
        if len(which) and which[-1] == UNDATED and (not dates or dates[-1].position <= halves.position[-1]):
            self._date = None
        dated = np.flatnonzero(which != UNDATED)
        self._undated += len(which) - len(dated)
        self._samples_of_piece = Placed.none(self._last)
        if not len(dated):
            return [], []
        which = which[dated]
        words, low16 = halves.words[dated], accel["index_low16"][dated]
        base = np.array([d.index for d in dates], dtype=np.int64)[which]
        # The nearest index with these low bits: a first half may have come just before its date.
        since = (low16.astype(np.int64) - base + 0x8000) % 0x10000 - 0x8000
        index = ((base + since) & MASK32).astype(np.uint64)
        dated_us = np.array([d.t_us for d in dates], dtype=np.int64)[which]
        t_us = (dated_us + since * SAMPLE_PERIOD_US).astype(np.uint64)
        boot = np.array([d.boot_id for d in dates], dtype=np.uint16)[which]
        ones = np.ones(len(index), dtype=np.uint8)
        spans, events = self._tracker.place(Groups(boot, index.astype(np.uint32), t_us, ones))
        segments = []
        for span in spans:
            rows = slice(span.start, span.stop)
            numbered = np.uint64(span.first_index) + np.arange(span.stop - span.start, dtype=np.uint64)
            samples = device_samples(t_us[rows], index[rows], words[rows])
            segments.append(Segment(span.boot_id, span.run, numbered, samples))
        self._samples_of_piece = Placed(halves.position[dated], boot, t_us, index, self._last)
        self._last = self._samples_of_piece.latest(_BEHIND_ALL)
        began = {span.run: int(halves.position[dated][span.start]) for span in reversed(spans)}
        return segments, [_with_start(event, began, starts) for event in events]

    def _answers(
        self, at: NDArray[np.intp], identifiers: NDArray[np.unsignedinteger[Any]], words: Words
    ) -> tuple[Statuses | tuple[()], tuple[Response, ...], tuple[Pong, ...]]:
        """Of frames that are no data (N,): where in the piece they stood, what they are, what they say."""
        responses: list[Response] = []
        pongs: list[Pong] = []
        # A START amid them changes what those behind it count from.
        began = any(_starts(scalars(RESPONSE, int(w))) for w in words[identifiers == RESPONSE.frame_id])
        regular = None if began else regular_sets(identifiers, words)
        came = np.arange(len(at))
        if regular is None:
            said = [self._answer_each(came, at, identifiers, words, responses, pongs)]
        else:
            first = regular.frames[0]
            left = np.setdiff1d(came, regular.frames, assume_unique=True)
            said = [self._answer_each(left[left < first], at, identifiers, words, responses, pongs)]
            said.append(self._regular(regular, at))
            said.append(self._answer_each(left[left > first], at, identifiers, words, responses, pongs))
        parts = [part for part in said if len(part)]
        return Statuses.joined(parts) if parts else (), tuple(responses), tuple(pongs)

    def _regular(self, sets: RegularSets, at: NDArray[np.intp]) -> Statuses:
        """The statuses of sets that are all there; `at` is where each frame stood."""
        self._good += len(sets.frames)
        headers = np.zeros(len(sets.last), HEADER)
        latest = self._samples_of_piece.latest_each(at[sets.last])
        headers["boot_id"], headers["t0_us"], headers["first_index"] = latest
        if self._start_index is not None:
            produced = STATUS[0].unpack(sets.words[:, 0])["produced"]
            headers["first_index"] = (np.uint64(self._start_index) + produced) & np.uint64(MASK32)
        return Statuses(headers, sets.words, np.full(len(headers), sets.sent, np.int64))

    def _answer_each(
        self,
        which: NDArray[np.intp],
        at: NDArray[np.intp],
        identifiers: NDArray[np.unsignedinteger[Any]],
        words: Words,
        responses: list[Response],
        pongs: list[Pong],
    ) -> Statuses:
        """The statuses among those frames; responses and pongs are added to."""
        told: list[tuple[tuple[int, int, int], list[int]]] = []
        asked = (each[which].tolist() for each in (at, identifiers, words))
        for place, identifier, word in zip(*asked, strict=True):
            layout = _ANSWERS.get(identifier)
            if layout is None:
                continue
            self._good += 1
            if layout is RESPONSE:
                responses.append(self._response(scalars(RESPONSE, word), place))
            elif layout is PONG:
                pongs.append(self._pong(scalars(PONG, word), place))
            else:
                self._status_part(identifier, word, place, told)
        headers = np.zeros(len(told), HEADER)
        for n, (header, _) in enumerate(told):
            headers[n]["boot_id"], headers[n]["t0_us"], headers[n]["first_index"] = header
        return Statuses.of(headers, [(n, np.array(parts, np.uint64)) for n, (_, parts) in enumerate(told)])

    def _response(self, signals: dict[str, int], at: int) -> Response:
        boot_id, t_us, next_index = self._samples_of_piece.latest(at)
        if _starts(signals):
            self._start_index = next_index = signals["value"]
        elif signals["opcode"] == OPCODE["STOP"] and self._start_index is not None:
            next_index = (self._start_index + signals["value"]) & MASK32  # its value is the samples produced
        return Response(boot_id, t_us, next_index, **signals)

    def _pong(self, signals: dict[str, int], at: int) -> Pong:
        boot_id, latest_us, _ = self._samples_of_piece.latest(at)
        half = 1 << 31  # the nearest instant with these low bits: the ping may be before the latest sample
        t2_us = latest_us + (signals["t2_us"] - latest_us + half) % (2 * half) - half
        t2_us += 2 * half if t2_us < 0 else 0
        return Pong(boot_id, signals["request_id"], t2_us, t2_us + signals["hold_us"])

    def _status_part(
        self, identifier: int, word: int, at: int, told: list[tuple[tuple[int, int, int], list[int]]]
    ) -> None:
        """STATUS_BUS comes last; a set without one of those that every board sends is dropped."""
        if identifier == STATUS[0].frame_id:
            self._status.clear()
        self._status[identifier] = word
        if identifier != STATUS_LAST or not self._status.keys() >= STATUS_ALWAYS:
            return
        parts = [self._status[layout.frame_id] for layout in STATUS if layout.frame_id in self._status]
        self._status.clear()
        boot_id, t_us, next_index = self._samples_of_piece.latest(at)
        if self._start_index is not None:
            next_index = (self._start_index + scalars(STATUS[0], parts[0])["produced"]) & MASK32
        told.append(((boot_id, t_us, next_index), parts))


def _followed(pair: NDArray[np.intp], word: Words, first: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether the first half of the very next sample stands behind each pair, shape (N,)."""
    there = pair + 2 < len(word)
    behind = np.where(there, pair + 2, pair)
    step = ACCEL.unpack(word[behind])["index_low16"] - ACCEL.unpack(word[pair])["index_low16"]
    followed: NDArray[np.bool_] = there & first[behind] & ((step & np.uint64(0xFFFF)) == 1)
    return followed


def _with_start(event: Loss | NewRun, began: dict[int, int], starts: list[tuple[int, int]]) -> Loss | NewRun:
    """A new run with the first index that the START before it named."""
    if not isinstance(event, NewRun):
        return event
    named = [value for position, value in starts if position <= began[event.run]]
    return replace(event, start_index=named[-1] if named else None)


def _starts(response: dict[str, int]) -> bool:
    return response["opcode"] == OPCODE["START"] and response["result"] == RESULT["OK"]
