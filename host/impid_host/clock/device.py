"""Host clock to board clock by four-timestamp exchanges.

One exchange: the host sends a ping at t1, the board receives it at t2 and answers at t3, the host has the
answer at t4. With equal delays both ways the board is ahead by ((t2 - t1) + (t3 - t4)) / 2; unequal delays
shift that by half their difference, which no exchange can see. So an exchange is worth the more the
shorter it took: only the quickest fifth is used, each weighted by how little time it leaves for an asymmetry.
The difference of two fixed delays stays invisible; half the smallest round trip is its hard bound.

Nothing here changes a time stamp: exchanges are stored raw, and a fit is computed whenever one is wanted.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import overload

import numpy as np
from numpy.typing import NDArray

from impid_host.errors import UndeterminedError
from impid_host.signals.quantiles import student_975

Floats = NDArray[np.float64]

EXCHANGE_RATE_HZ = 10.0
KEPT_FRACTION = 0.2
MAX_DRIFT_PPM = 500.0
# Asymmetry that even the quickest exchange may hide on top of the fixed one: a scheduler tick, a USB poll.
_SOFTENING_US = 10.0
# Half the difference of two delays whose excess adds up to s lies anywhere in ± s/2 (variance s^2/12).
_UNIFORM_VARIANCE = 1 / 12
_FEWEST = 3
# Both clocks' stamps are cut to whole microseconds on the board.
_STAMP_US = 2.0
_KEPT_AT_LEAST = 10  # at the start a fifth would be too few for an interval; the weights sort them out


@dataclass(frozen=True, slots=True)
class ClockExchange:
    """t1, t4 on the host's monotonic clock (ns); t2, t3 on the board's clock (us since boot)."""

    t1_ns: int
    t2_us: int
    t3_us: int
    t4_ns: int


class Exchanges(Sequence[ClockExchange]):
    """Exchanges in order, 32 bytes each: rows of t1_ns, t2_us, t3_us, t4_ns, shape (N, 4)."""

    __hash__ = None  # type: ignore[assignment]  # they compare as lists do

    def __init__(self, rows: NDArray[np.int64]) -> None:
        self.rows = rows

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, which: int) -> ClockExchange: ...
    @overload
    def __getitem__(self, which: slice) -> "Exchanges": ...
    def __getitem__(self, which: int | slice) -> "ClockExchange | Exchanges":
        if isinstance(which, slice):
            return Exchanges(self.rows[which])
        return ClockExchange(*self.rows[which].tolist())

    def __iter__(self) -> Iterator[ClockExchange]:
        return (ClockExchange(*row) for row in self.rows.tolist())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)


@dataclass(frozen=True, slots=True)
class ClockEstimate:
    """Board time as a line over host time: board = host + offset + drift * (host - reference).

    Attributes:
        reference_host_us: the host instant (us, nominal rate taken in) at which offset_us holds.
        offset_us: board minus host at the reference.
        offset_interval_us: half width of the 95 % interval of the offset, symmetric delays assumed.
        drift_ppm: rate of the board against nominal_rate times the host's.
        drift_interval_ppm: half width of its 95 % interval.
        hard_bound_us: half the smallest round trip: no asymmetry of the delays can shift the offset further.
        exchanges: number of exchanges seen, and of those, `used` carried the estimate.
        nominal_rate: board seconds in a host second; 1 for a real board, the speed of a simulated one.
    """

    reference_host_us: float
    offset_us: float
    offset_interval_us: float
    drift_ppm: float
    drift_interval_ppm: float
    hard_bound_us: float
    exchanges: int
    used: int
    nominal_rate: float = 1.0

    def board_us(self, host_ns: float) -> float:
        """Board time (us since boot) at a host instant (ns of the monotonic clock)."""
        host_us = host_ns * 1e-3 * self.nominal_rate
        return host_us + self.offset_us + self.drift_ppm * 1e-6 * (host_us - self.reference_host_us)

    def __str__(self) -> str:
        return (
            f"clock ±{self.offset_interval_us:.0f} us (hard bound ±{self.hard_bound_us:.0f} us), "
            f"drift {self.drift_ppm:+.1f} ± {self.drift_interval_ppm:.1f} ppm"
        )


def fit_clock(
    exchanges: Sequence[ClockExchange],
    *,
    nominal_rate: float = 1.0,
    reference_host_us: float | None = None,
    max_drift_ppm: float = MAX_DRIFT_PPM,
) -> ClockEstimate:
    """Weighted line through the quickest fifth of the exchanges.

    Without a reference it is centred: the offset holds in the middle of the exchanges used, where it
    is best known and independent of the drift. The drift is held within ± max_drift_ppm, which crystals
    keep and a few chance delays at the start of a recording do not.

    Raises:
        UndeterminedError: fewer than three exchanges, or exchanges no clock within the bound can have made.
    """
    if len(exchanges) < _FEWEST:
        raise UndeterminedError(
            f"{len(exchanges)} clock exchanges do not determine a clock; it takes {_FEWEST}"
        )
    host_us, ahead_us, rtt_us = _offsets(exchanges, nominal_rate)
    if _impossible(host_us, ahead_us, rtt_us, max_drift_ppm * 1e-6):
        raise UndeterminedError(
            f"the exchanges contradict a board clock within {max_drift_ppm:g} ppm of {nominal_rate:g} times "
            "the PC's clock, so no offset is given; is this a simulator that runs faster than real time, or "
            "does the board run on the wrong crystal?"
        )
    used = np.argsort(rtt_us, kind="stable")[: max(_KEPT_AT_LEAST, round(KEPT_FRACTION * len(rtt_us)))]
    smallest = float(rtt_us[used[0]])
    x, y = host_us[used], ahead_us[used]
    weight = 1.0 / (rtt_us[used] - smallest + _SOFTENING_US) ** 2
    centre, slope = _line(x, y, weight, max_drift_ppm * 1e-6)
    level = float(weight @ y / weight.sum())
    reference = centre if reference_host_us is None else reference_host_us
    spread = float(weight @ (x - centre) ** 2)
    residual = y - level - slope * (x - centre)
    # The quickest weigh so much that few exchanges carry the fit: their effective number sets the freedom.
    freedom = max(1.0, float(weight.sum() ** 2 / (weight @ weight)) - 2)
    variance = max(float(weight @ residual**2) / (len(used) - 2), _UNIFORM_VARIANCE)
    half_width = float(student_975(freedom))
    # The bound on the drift is knowledge too: it also bounds how wrong the drift can be.
    slope_interval = (
        min(half_width * np.sqrt(variance / spread), max_drift_ppm * 1e-6) if spread > 0 else np.inf
    )
    level_interval = half_width * np.sqrt(variance / weight.sum())
    bound = smallest / 2
    return ClockEstimate(
        reference_host_us=reference,
        offset_us=level + slope * (reference - centre),
        offset_interval_us=float(np.hypot(level_interval, slope_interval * (reference - centre))),
        drift_ppm=slope * 1e6,
        drift_interval_ppm=float(slope_interval) * 1e6,
        hard_bound_us=bound,
        exchanges=len(exchanges),
        used=len(used),
        nominal_rate=nominal_rate,
    )


def _offsets(exchanges: Sequence[ClockExchange], nominal_rate: float) -> tuple[Floats, Floats, Floats]:
    """Host instant, board minus host, and round-trip time less the board's hold; us, each of shape (N,)."""
    if isinstance(exchanges, Exchanges):
        rows = exchanges.rows
    else:
        rows = np.array([(e.t1_ns, e.t2_us, e.t3_us, e.t4_ns) for e in exchanges], dtype=np.int64)
    # Integers until the large common part is gone: nanoseconds since the PC's boot do not fit a double.
    origin_ns, origin_us = int(rows[0, 0]), int(rows[0, 1])
    t1, t4 = ((rows[:, n] - origin_ns) * 1e-3 * nominal_rate for n in (0, 3))
    t2, t3 = ((rows[:, n] - origin_us).astype(np.float64) for n in (1, 2))
    origin = origin_ns * 1e-3 * nominal_rate
    ahead = ((t2 - t1) + (t3 - t4)) / 2 + (origin_us - origin)
    return (t1 + t4) / 2 + origin, ahead, (t4 - t1) - (t3 - t2)


def _impossible(x: Floats, y: Floats, rtt: Floats, max_slope: float) -> bool:
    """Whether no clock whose rate stays within ± max_slope passes through every y ± rtt/2.

    That interval holds the truth whatever the delays were. The rate need not be constant: a crystal that
    warms up is no contradiction.
    """
    half = rtt / 2 + _STAMP_US
    if (half < 0).any():  # the board held the answer for longer than the whole exchange took
        return True
    order = np.argsort(x, kind="stable")
    x, low, high = x[order] - x[order[0]], (y - half)[order], (y + half)[order]
    too_fast = low - max_slope * x > np.minimum.accumulate(high - max_slope * x)
    too_slow = high + max_slope * x < np.maximum.accumulate(low + max_slope * x)
    return bool((too_fast | too_slow).any())


def _line(x: Floats, y: Floats, weight: Floats, max_slope: float) -> tuple[float, float]:
    """Weighted centre of x, and the slope of the weighted line, held within ± max_slope."""
    centre = float(weight @ x / weight.sum())
    spread = float(weight @ (x - centre) ** 2)
    slope = float(weight @ ((x - centre) * y)) / spread if spread > 0 else 0.0
    return centre, float(np.clip(slope, -max_slope, max_slope))


def load() -> None:
    """Import what the first fit needs: on a busy machine that takes seconds, which a recording under way does
    not have."""
    student_975(1.0)


@dataclass(slots=True)
class OnlineClock:
    """The clock as far as it is known now: a fit over the last `window_s` seconds, referred to their end.

    Exchanges of an earlier boot say nothing about this one: make a new OnlineClock at a reboot.
    """

    nominal_rate: float = 1.0
    window_s: float = 60.0
    _window: deque[ClockExchange] = field(default_factory=deque)

    def add(self, exchange: ClockExchange) -> None:
        """Take one exchange in; the oldest leave the window."""
        self._window.append(exchange)
        while (exchange.t4_ns - self._window[0].t1_ns) * 1e-9 > self.window_s:
            self._window.popleft()

    def estimate(self) -> ClockEstimate | None:
        """The estimate at the latest exchange; None while the exchanges do not determine it."""
        if len(self._window) < _FEWEST:
            return None
        latest_us = self._window[-1].t4_ns * 1e-3 * self.nominal_rate
        try:
            return fit_clock(list(self._window), nominal_rate=self.nominal_rate, reference_host_us=latest_us)
        except UndeterminedError:
            return None
