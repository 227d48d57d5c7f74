"""General-purpose timers (RM0390 chapter 17, TIM2 to TIM5; chapter 18, TIM12): configuration, inputs, output.

Counting, triggers and captures are in timer.c. Inputs are edges on TI1 and TI2, or a position that the
encoder interface follows.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.chip import CData, ffi, lib
from hil_sim.board.elf.compare import FORCE_LOW, FROZEN, MODE_AT, MODE_MASK, TOGGLE, CompareOutput
from hil_sim.board.elf.registers import ALL, Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

CEN, URS, ARPE = 1 << 0, 1 << 2, 1 << 7
FOLLOWS_NOTHING, FOLLOWS_WORLD, FOLLOWS_PYTHON = range(3)
INTERNAL, ENCODER_TI2, ENCODER_TI1, ENCODER_BOTH, TRIGGER = 0, 1, 2, 3, 6
CHANNELS = (1, 2, 3, 4)
# Tables "TIMx internal trigger connection" (17.4.3, 18.4.3): what ITR0 to ITR3 of each timer are.
INTERNAL_TRIGGERS = {
    "TIM2": ("TIM1", "TIM8", "TIM3", "TIM4"),
    "TIM3": ("TIM1", "TIM2", "TIM5", "TIM4"),
    "TIM4": ("TIM1", "TIM2", "TIM3", "TIM8"),
    "TIM5": ("TIM2", "TIM3", "TIM4", "TIM8"),
    "TIM12": ("TIM4", "TIM5", "TIM13", "TIM14"),
}
# Input filter (17.4.7, ICxF): cycles between readings, and readings that must agree.
FILTERS = (
    (1, 0), (1, 2), (1, 4), (1, 8), (2, 6), (2, 8), (4, 6), (4, 8),
    (8, 6), (8, 8), (16, 5), (16, 6), (16, 8), (32, 5), (32, 6), (32, 8),
)  # fmt: skip
# Counting direction against encoder signals (17.3.12): rising TI1 while TI2 is low counts up, and so on.
# Key: (input whose edge it is, its new level, level of the other input).
DIRECTION = {
    (1, True, False): 1, (1, False, True): 1, (1, True, True): -1, (1, False, False): -1,
    (2, True, True): 1, (2, False, False): 1, (2, True, False): -1, (2, False, True): -1,
}  # fmt: skip


class Timer(Peripheral):
    """Up-counter, encoder interface, capture, trigger in and out; channel 1 as an output in two modes."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("CR1", 0x00, "17.4.1", modelled=CEN | URS | ARPE),
        Register("CR2", 0x04, "17.4.2", modelled=0x0020),
        Register("SMCR", 0x08, "17.4.3", modelled=0x0037),
        Register("DIER", 0x0C, "17.4.4", modelled=0x1F1F),
        Register("SR", 0x10, "17.4.5", modelled=ALL),
        Register("EGR", 0x14, "17.4.6", modelled=1),
        Register("CCMR1", 0x18, "17.4.7", modelled=0xF3F3),
        Register("CCMR2", 0x1C, "17.4.8", modelled=0xF3F3),
        Register("CCER", 0x20, "17.4.9", modelled=0x3333),
        Register("CNT", 0x24, "17.4.10", modelled=ALL),
        Register("PSC", 0x28, "17.4.11", modelled=0xFFFF),
        Register("ARR", 0x2C, "17.4.12", modelled=ALL),
        Register("CCR1", 0x34, "17.4.13", modelled=ALL),
        Register("CCR2", 0x38, "17.4.14"),
        Register("CCR3", 0x3C, "17.4.15"),
        Register("CCR4", 0x40, "17.4.16"),
    )
    WIDTHS = (2, 4)

    def __init__(self, name: str, base: int, soc: "Soc", irq: int) -> None:
        super().__init__(name, base, soc)
        self.width = 32 if name in ("TIM2", "TIM5") else 16
        self._top = (1 << self.width) - 1
        self.value["ARR"] = self.shared.arr = self._top
        self.shared.irq = irq
        self.shared.number = getattr(lib, name)
        self._levels = {1: False, 2: False}
        self.output = CompareOutput(self)
        self._position: Callable[[], int] | None = None
        self._listen()

    def _shared(self) -> CData:
        timer = ffi.new("timer *")
        lib.timer_bind(timer)
        return timer

    # --- counting -----------------------------------------------------------------------------------

    @property
    def mode(self) -> int:
        """SMS."""
        return self.value["SMCR"] & 7

    @property
    def encoder(self) -> bool:
        """The counter follows an encoder."""
        return self.mode in (ENCODER_TI1, ENCODER_TI2, ENCODER_BOTH)

    @property
    def enabled(self) -> bool:
        """CEN."""
        return bool(self.value["CR1"] & CEN)

    @property
    def _free_running(self) -> bool:
        return self.enabled and self.mode in (INTERNAL, TRIGGER)

    def count(self) -> int:
        """CNT now."""
        return int(lib.timer_count(self.shared))

    def next_update(self) -> int | None:
        """The cycle of the next update event, if the counter runs."""
        return int(self.shared.overflow.cycle) if self.shared.overflow else None

    def _restart(self, count: int) -> None:
        """Counting goes on from a value at this instant, with an empty prescaler."""
        lib.timer_restart(self.shared, count)

    # --- triggers and captures ----------------------------------------------------------------------

    def trigger_source(self) -> str | None:
        """The timer whose TRGO is this one's TRGI, or None for the timer's own inputs."""
        selection = self.value["SMCR"] >> 4 & 7
        return INTERNAL_TRIGGERS[self.name][selection] if selection < 4 else None

    def _listen(self) -> None:
        """Whose trigger output it hears."""
        names, source = list(INTERNAL_TRIGGERS), self.trigger_source()
        self.shared.source = names.index(source) if source in names else -1

    def _capture_selection(self, channel: int) -> int:
        register = self.value["CCMR1" if channel < 3 else "CCMR2"]
        return register >> (8 if channel % 2 == 0 else 0) & 3

    def edge(self, channel: int, rising: bool) -> None:
        """An edge on TI1 or TI2: captures, and counts in the encoder modes."""
        self._levels[channel] = rising
        falling_selected = bool(self.value["CCER"] >> (4 * (channel - 1) + 1) & 1)
        direct = self._capture_selection(channel) == 1
        if self.encoder and self.enabled:
            self._encoder_edge(channel, rising)
        elif direct and rising != falling_selected:
            lib.timer_capture(self.shared, channel)

    def filter_seconds(self, channel: int) -> float:
        """Pulses shorter than this do not pass the input's filter (17.3.6)."""
        between, readings = FILTERS[self.value["CCMR1"] >> (4 if channel == 1 else 12) & 15]
        cycles = between * readings * self.soc.rcc.timer_divider(1)
        return cycles / self.soc.schedule.frequency

    def pulse(self, channel: int, seconds: float) -> None:
        """A high pulse on TI1 or TI2, from now on; nothing if the filter swallows it."""
        if seconds > self.filter_seconds(channel):
            self.edge(channel, True)
            self.soc.schedule.after_seconds(seconds, lambda: self.edge(channel, False))

    # --- encoder interface (17.3.12) ----------------------------------------------------------------

    def _inverted(self, channel: int) -> bool:
        return bool(self.value["CCER"] >> (4 * (channel - 1) + 1) & 1)

    def _encoder_edge(self, channel: int, rising: bool) -> None:
        counts_on = {ENCODER_TI2: (2,), ENCODER_TI1: (1,), ENCODER_BOTH: (1, 2)}[self.mode]
        if channel in counts_on:
            other = 3 - channel
            level = rising != self._inverted(channel)
            turn = DIRECTION[channel, level, self._levels[other] != self._inverted(other)]
            lib.timer_turn(self.shared, turn)

    @property
    def position(self) -> Callable[[], int] | None:
        """Where the encoder is, in quarter periods; None: there is no encoder."""
        return self._position

    @position.setter
    def position(self, position: Callable[[], int] | None) -> None:
        self._position = position
        self.shared.follows = FOLLOWS_NOTHING if position is None else FOLLOWS_PYTHON

    def follow_world(self, axis: int, position: Callable[[], int]) -> None:
        """Follows an encoder of the C part's world; `position` says the same to Python."""
        self._position = position
        self.shared.follows, self.shared.axis = FOLLOWS_WORLD, axis
        self.shared.signals = [self.soc.signal(f"{self.name}_CH{channel}") for channel in (1, 2)]

    # --- registers ----------------------------------------------------------------------------------

    def read_cr1(self) -> int:
        """CEN also set by the trigger mode; DIR by the encoder interface."""
        self.count()
        return self.value["CR1"]

    def write_cr1(self, value: int) -> None:
        """CEN starts or stops the counter."""
        now = self.count()
        self.value["CR1"] = value
        if self.encoder and self.enabled:
            lib.timer_place(self.shared)
        self._restart(now)

    def write_smcr(self, value: int) -> None:
        """Slave mode and trigger selection; TS may change only while SMS is 0 (17.4.3)."""
        if value & 7 in (4, 5):
            raise self.unmodelled("write", "SMCR", 0x08, value)  # reset and gated mode
        if (self.value["SMCR"] ^ value) & 0x70 and self.mode:
            raise self.violation("TS changed while a slave mode is selected", "17.4.3")
        now = self.count()
        self.value["SMCR"] = value
        self._listen()
        lib.timer_place(self.shared)
        self._restart(now)

    def write_dier(self, value: int) -> None:
        """Interrupt and DMA enables."""
        self.value["DIER"] = value
        lib.timer_update_line(self.shared)

    def read_sr(self) -> int:
        """Flags."""
        return self.read(0x10, 4)

    def read_egr(self) -> int:
        """Write-only: reads as 0."""
        return 0

    def write_egr(self, value: int) -> None:
        """UG: an update by software; the counter starts again from 0 (17.4.6)."""
        if value & 1:
            self.count()
            lib.timer_update(self.shared, not self.value["CR1"] & URS)
            self._restart(0)

    def _write_channels(self, register: str, offset: int, value: int) -> None:
        """Captures of the channel's own input or of TRC; crossed inputs and other outputs have no model."""
        as_output = register == "CCMR1" and value & ~MODE_MASK == 0
        mode = value >> MODE_AT if as_output else FROZEN
        for half in () if as_output else (value & 0xFF, value >> 8):
            if half and half & 3 not in (1, 3):
                raise self.unmodelled("write", register, offset, value)
        if mode not in (FROZEN, TOGGLE, FORCE_LOW) or (mode != FROZEN and not self._free_running):
            raise self.unmodelled("write", register, offset, value)
        if register == "CCMR1":
            self.output.set_mode(mode)
        self.value[register] = value
        self.shared.trc_channels = sum(
            1 << channel for channel in CHANNELS if self._capture_selection(channel) == 3
        )

    def write_ccmr1(self, value: int) -> None:
        """Modes of channels 1 and 2."""
        self._write_channels("CCMR1", 0x18, value)

    def write_ccmr2(self, value: int) -> None:
        """Modes of channels 3 and 4."""
        self._write_channels("CCMR2", 0x1C, value)

    def write_ccer(self, value: int) -> None:
        """Capture enables and edges; both edges at once (CCxNP with CCxP) has no model."""
        self.value["CCER"] = value

    def write_cnt(self, value: int) -> None:
        """Sets the counter."""
        self.count()
        self._restart(value & self._top)

    def write_arr(self, value: int) -> None:
        """At once without ARPE, at the next update with it (17.3.1)."""
        now = self.count()
        self.value["ARR"] = value & self._top
        if not self.value["CR1"] & ARPE:
            self.shared.arr = self.value["ARR"]
            if self._free_running:
                self._restart(now)

    def write_ccr1(self, value: int) -> None:
        """Where an output matches, at once (no OC1PE); read-only while the channel is an input (17.4.13)."""
        if self._capture_selection(1):
            raise self.unmodelled("write", "CCR1", 0x34, value)
        self.output.set_match(value & self._top)

    def read_ccr1(self) -> int:
        """Capture of channel 1; reading clears CC1IF (17.4.5)."""
        return int(lib.timer_read_capture(self.shared, 1))

    def read_ccr3(self) -> int:
        """Capture of channel 3; reading clears CC3IF (17.4.5)."""
        return int(lib.timer_read_capture(self.shared, 3))
