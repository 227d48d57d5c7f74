"""What the board shows of its own timing when a wire leads the sampling timer's edge to its inputs.

The timer that starts the conversions and latches the counters makes an edge at a known clock of its period
(11.1 ns each). Moving that clock until the reading changes tells which instant a reading belongs to: the edge
that is only just seen. Both lines of an encoder are held by the chip's resistors alone, where no wire is:
stepped in turn they are a quadrature signal without any wire.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from impid_host.bring_up.board import RELEASED, TIMER_HZ, BenchBoard
from impid_host.bring_up.result import Result, not_measured

FORWARD = (0b01, 0b11, 0b10, 0b00)  # lines A (bit 0) and B (bit 1): A leads
TURNS = 8
_SETTLE_S = 0.005
_EARLY, _LATE = -120, 250  # clocks from the trigger: certainly seen, certainly not
_AROUND = 5  # clocks on either side of the change that are looked at closely
_LOOKS = 8
_LOW, _HIGH = 400, 3700  # codes: what the edge reaches over a wire, and a sensor does not


class Operator(Protocol):
    """Who stands at the bench; every question may be refused."""

    def bare(self) -> bool:
        """Nothing is wired to the encoder, fault and sync inputs."""

    def wire(self, signal: str) -> bool:
        """The wire leads from the edge output to `encoder 1 A`, `encoder 2 A`, `x` or `y`."""

    def unwire(self) -> bool:
        """The wire is off."""

    def unplug(self) -> bool:
        """Is ready to pull the plug, once, at any moment from now on, and to put it back."""


def quadrature(board: BenchBoard, encoder: int) -> Result:
    """Turns an encoder's lines by the chip's own resistors: forwards, then back."""
    shift = 2 * (encoder - 1)
    what = f"quadrature by the pull resistors, encoder {encoder}"

    def step(lines: int) -> None:
        board.bench("LEVELS", lines << shift)
        board.wait(_SETTLE_S)

    step(0)
    start = board.count(encoder)
    for lines in FORWARD * TURNS:
        step(lines)
    forward = board.count(encoder) - start
    for lines in (FORWARD[2], FORWARD[1], FORWARD[0], FORWARD[3]) * TURNS:
        step(lines)
    back = board.count(encoder) - start
    board.bench("LEVELS", RELEASED)
    if back != 0:
        return Result(
            what,
            float(forward - back),
            "counts",
            4.0 * TURNS,
            4.0 * TURNS,
            f"forwards {forward}, and back at {back} instead of 0",
        )
    return Result(
        what,
        float(forward),
        "counts",
        4.0 * TURNS,
        4.0 * TURNS,
        "and back at 0",
        "whether both pins are bonded, soldered and multiplexed as the table says",
    )


@dataclass(frozen=True, slots=True)
class Instant:
    """Which instant a reading belongs to.

    Attributes:
        clocks: of the edge that half of the readings see, from the trigger on, in timer clocks.
        unsure: offsets at which some readings see the edge and some do not.
    """

    clocks: float
    unsure: int

    @property
    def us(self) -> float:
        """Microseconds from the trigger on."""
        return self.clocks / TIMER_HZ * 1e6


Read = Callable[[], int | None]


def find_instant(board: BenchBoard, read: Read) -> Instant | None:
    """The instant of a reading that the edge changes; None: nothing changes it."""

    def at(offset: int) -> int | None:
        board.bench("EDGE", offset if offset >= 0 else period + offset)
        board.wait(_SETTLE_S)
        return read()

    period = board.bench("EDGE", 0)
    try:
        seen, unseen = at(_EARLY), at(_LATE)
        if seen is None or unseen is None or seen == unseen:
            return None
        low, high = _EARLY, _LATE
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if at(middle) == seen else (low, middle)
        shares = []
        for offset in range(high - _AROUND, high + _AROUND):
            looks = [at(offset) == seen]
            for _ in range(_LOOKS - 1):
                board.wait(_SETTLE_S)
                looks.append(read() == seen)
            shares.append(sum(looks) / _LOOKS)
        # An edge at the offset `high - 1` is seen: the boundary lies half a clock behind it.
        return Instant(high - _AROUND + sum(shares) - 0.5, sum(0 < share < 1 for share in shares))
    finally:
        board.bench("EDGE", period)


# Offsets in microseconds from the trigger; the numbers of sampling.h with room for the wire and the pins.
_ENCODER_BOUND = (-0.20, 0.02)
_CONVERTER_BOUND = (0.60, 0.90)
SIGNALS = ("encoder 2 A", "encoder 1 A", "x", "y")


def latch_instants(board: BenchBoard, operator: Operator) -> list[Result]:
    """Where counters and converters stand against the trigger, and against each other."""
    found: dict[str, float] = {}
    results = []
    board.bench("LEVELS", 0)  # line B of both low: line A alone counts
    for signal in SIGNALS:
        encoder = signal.startswith("encoder")
        what = f"instant of the {'counts' if encoder else 'voltage'}, {signal}"
        silicon = (
            "filter and resynchronisation: -0.10 to -0.04 us by the manual, no delay in the emulator"
            if encoder
            else "the converter's start: 0.76 to 0.81 us by the data sheet, 0.67 us in the emulator"
        )
        if not operator.wire(signal):
            results.append(not_measured(what, "the wire was not put on", silicon))
            continue
        instant = find_instant(board, _reader(board, signal))
        if instant is None:
            results.append(not_measured(what, "no edge arrives: is the wire on these two pins?", silicon))
            continue
        found[signal] = instant.us
        low, high = _ENCODER_BOUND if encoder else _CONVERTER_BOUND
        detail = f"from the trigger; unsure at {instant.unsure} clocks of 11.1 ns"
        results.append(Result(what, instant.us, "us", low, high, detail, silicon))
    board.bench("LEVELS", RELEASED)
    operator.unwire()
    what = "latch skew, voltage behind counts"
    counts = [us for signal, us in found.items() if signal.startswith("encoder")]
    voltages = [us for signal, us in found.items() if not signal.startswith("encoder")]
    if not counts or not voltages:
        return [*results, not_measured(what, "it takes an encoder and an axis")]
    worst = max(voltages) - min(counts)
    detail = f"largest of {len(counts) * len(voltages)}; smallest {min(voltages) - max(counts):.3f} us"
    silicon = "0.80 to 0.91 us is what sampling.h derives; a micrometre at 1 m/s"
    return [*results, Result(what, worst, "us", 0.0, 1.0, detail, silicon)]


def _reader(board: BenchBoard, signal: str) -> Read:
    """The count, or whether the voltage is high; None: it is neither high nor low."""
    if signal.startswith("encoder"):
        encoder = int(signal.split()[1])
        return lambda: board.count(encoder)

    def level() -> int | None:
        code = board.code(signal)
        return 0 if code < _LOW else 1 if code > _HIGH else None

    return level
