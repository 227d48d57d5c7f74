"""General-purpose timers (RM0390 chapter 17, TIM2 to TIM5; chapter 18, TIM12).

Counting is lazy: a running counter is its value at a known cycle plus the cycles since. Only what others can
notice (an update, a trigger) is an event. Inputs are edges on TI1 and TI2, or a position that the
encoder interface follows.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.registers import ALL, Peripheral, Register
from hil_sim.board.elf.schedule import Event

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

CEN, URS, ARPE, DIR = 1 << 0, 1 << 2, 1 << 7, 1 << 4
MMS_RESET, MMS_UPDATE = 0, 2
INTERNAL, ENCODER_TI2, ENCODER_TI1, ENCODER_BOTH, TRIGGER, EXTERNAL = 0, 1, 2, 3, 6, 7
UIE, UIF = 1, 1
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
    """Up-counter, encoder interface, input capture, trigger in and out; no compare outputs."""

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
        Register("CCR1", 0x34, "17.4.13"),
        Register("CCR2", 0x38, "17.4.14"),
        Register("CCR3", 0x3C, "17.4.15"),
        Register("CCR4", 0x40, "17.4.16"),
    )
    WIDTHS = (2, 4)

    def __init__(self, name: str, base: int, soc: "Soc", irq: int) -> None:
        super().__init__(name, base, soc)
        self.irq = irq
        self.width = 32 if name in ("TIM2", "TIM5") else 16
        self._top = (1 << self.width) - 1
        self.value["ARR"] = self._top
        self._arr = self._top
        self._psc = 0
        self._count = 0
        self._since = 0
        self._overflow: Event | None = None
        self._levels = {1: False, 2: False}
        self._trc_channels: list[int] = []  # those that capture at a trigger
        self.position: Callable[[], int] | None = None
        self._last_position: int | None = None

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
    def step(self) -> int:
        """Processor cycles a count: (PSC + 1) cycles of the timer's clock."""
        return self.soc.rcc.timer_divider(1) * (self._psc + 1)

    @property
    def _free_running(self) -> bool:
        return self.enabled and self.mode in (INTERNAL, TRIGGER)

    def count(self) -> int:
        """CNT now."""
        if not self.value["CR1"] & CEN:
            return self._count
        mode = self.value["SMCR"] & 7
        if mode in (ENCODER_TI1, ENCODER_TI2, ENCODER_BOTH):
            self._follow()
        elif mode in (INTERNAL, TRIGGER):
            return (self._count + (self.soc.schedule.now - self._since) // self.step) % (self._arr + 1)
        return self._count

    def next_update(self) -> int | None:
        """The cycle of the next update event, if the counter runs."""
        return None if self._overflow is None or self._overflow.action is None else self._overflow.cycle

    def _restart(self, count: int) -> None:
        """Counting goes on from a value at this instant, with an empty prescaler."""
        self._count, self._since = count, self.soc.schedule.now
        if self._overflow is not None:
            self._overflow.cancel()
            self._overflow = None
        if self._free_running:
            if count > self._arr:
                raise self.violation(f"CNT {count} is above ARR {self._arr}", "17.3.2")
            self._overflow = self.soc.schedule.after((self._arr + 1 - count) * self.step, self._overflows)

    def _overflows(self) -> None:
        self._update(flag=True)
        self._restart(0)

    def _update(self, flag: bool) -> None:
        """Update event (17.3.2): preload registers, UIF, trigger output."""
        self._psc, self._arr = self.value["PSC"], self.value["ARR"]
        if flag:
            self._set_flag(UIF)
        if self.value["CR2"] >> 4 & 7 == MMS_UPDATE:
            self.soc.trgo(self.name)

    def _tick(self) -> None:
        """One edge of an external clock (external clock mode 1, 17.3.3)."""
        self._count += 1
        if self._count > self._arr:
            self._count = 0
            self._update(flag=True)

    # --- triggers and captures ----------------------------------------------------------------------

    def trigger_source(self) -> str | None:
        """The timer whose TRGO is this one's TRGI, or None for the timer's own inputs."""
        selection = self.value["SMCR"] >> 4 & 7
        return INTERNAL_TRIGGERS[self.name][selection] if selection < 4 else None

    def trigger(self) -> None:
        """A rising edge of TRGI, and of TRC behind it."""
        for channel in self._trc_channels:
            self._capture(channel)
        if self.mode == TRIGGER and not self.enabled:
            self.value["CR1"] |= CEN
            self._restart(self._count)
        elif self.mode == EXTERNAL and self.enabled:
            self._tick()

    def _capture_selection(self, channel: int) -> int:
        register = self.value["CCMR1" if channel < 3 else "CCMR2"]
        return register >> (8 if channel % 2 == 0 else 0) & 3

    def _capture(self, channel: int) -> None:
        """CCRx takes CNT; a second capture before the first was read sets CCxOF (17.3.6)."""
        if not self.value["CCER"] >> 4 * (channel - 1) & 1:
            return
        self.value[f"CCR{channel}"] = self.count()
        if self.value["SR"] >> channel & 1:
            self.value["SR"] |= 1 << (8 + channel)
        self._set_flag(1 << channel)
        if self.value["DIER"] >> (8 + channel) & 1:
            self.soc.dma_request(f"{self.name}_CH{channel}")

    def edge(self, channel: int, rising: bool) -> None:
        """An edge on TI1 or TI2: captures, and counts in the encoder modes."""
        self._levels[channel] = rising
        falling_selected = bool(self.value["CCER"] >> (4 * (channel - 1) + 1) & 1)
        direct = self._capture_selection(channel) == 1
        if self.encoder and self.enabled:
            self._encoder_edge(channel, rising)
        elif direct and rising != falling_selected:
            self._capture(channel)

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
            self._turn(DIRECTION[channel, level, self._levels[other] != self._inverted(other)])

    def _turn(self, counts: int) -> None:
        """CNT moves within 0..ARR; passing an end is an update event."""
        if not counts:
            return
        raw = self._count + counts
        self._count = raw % (self._arr + 1)
        self.value["CR1"] = self.value["CR1"] & ~DIR | (DIR if counts < 0 else 0)
        if raw != self._count:
            self._update(flag=True)

    def _follow(self) -> None:
        """Counts the edges that a moving encoder has produced since the last look.

        `position` is in quarter periods, so in the mode that counts every edge one step is one count.
        """
        if self.position is None:
            return
        here = self.position()
        if self._last_position is not None and here != self._last_position:
            if self.mode != ENCODER_BOTH:
                raise self.unmodelled("position in encoder mode", "SMCR", 0x08, self.mode)
            self._turn((here - self._last_position) * (-1 if self._inverted(1) != self._inverted(2) else 1))
        self._last_position = here

    # --- registers ----------------------------------------------------------------------------------

    def _set_flag(self, bits: int) -> None:
        self.value["SR"] |= bits
        if self.value["DIER"] & 0x1F:
            self._update_line()

    def _update_line(self) -> None:
        self.soc.nvic.set_line(self.irq, bool(self.value["SR"] & self.value["DIER"] & 0x1F))

    def read_cr1(self) -> int:
        """CEN also set by the trigger mode; DIR by the encoder interface."""
        self.count()
        return self.value["CR1"]

    def write_cr1(self, value: int) -> None:
        """CEN starts or stops the counter."""
        now = self.count()
        self.value["CR1"] = value
        if self.encoder and self.enabled:
            self._last_position = self.position() if self.position else None
        self._restart(now)

    def write_smcr(self, value: int) -> None:
        """Slave mode and trigger selection; TS may change only while SMS is 0 (17.4.3)."""
        if value & 7 in (4, 5):
            raise self.unmodelled("write", "SMCR", 0x08, value)  # reset and gated mode
        if (self.value["SMCR"] ^ value) & 0x70 and self.mode:
            raise self.violation("TS changed while a slave mode is selected", "17.4.3")
        now = self.count()
        self.value["SMCR"] = value
        self.soc.triggers_changed()
        self._last_position = self.position() if self.encoder and self.position else None
        self._restart(now)

    def write_dier(self, value: int) -> None:
        """Interrupt and DMA enables."""
        self.value["DIER"] = value
        self._update_line()

    def read_sr(self) -> int:
        """Flags."""
        self.count()
        return self.value["SR"]

    def write_sr(self, value: int) -> None:
        """Flags are cleared by writing zeros."""
        self.value["SR"] &= value
        self._update_line()

    def read_egr(self) -> int:
        """Write-only: reads as 0."""
        return 0

    def write_egr(self, value: int) -> None:
        """UG: an update by software; the counter starts again from 0 (17.4.6)."""
        if value & 1:
            self.count()
            self._update(flag=not self.value["CR1"] & URS)
            self._restart(0)

    def _write_channels(self, register: str, offset: int, value: int) -> None:
        """Captures of the channel's own input or of TRC; outputs and crossed inputs have no model."""
        for half in (value & 0xFF, value >> 8):
            if half and half & 3 not in (1, 3):
                raise self.unmodelled("write", register, offset, value)
        self.value[register] = value
        self._trc_channels = [channel for channel in CHANNELS if self._capture_selection(channel) == 3]

    def write_ccmr1(self, value: int) -> None:
        """Modes of channels 1 and 2."""
        self._write_channels("CCMR1", 0x18, value)

    def write_ccmr2(self, value: int) -> None:
        """Modes of channels 3 and 4."""
        self._write_channels("CCMR2", 0x1C, value)

    def write_ccer(self, value: int) -> None:
        """Capture enables and edges; both edges at once (CCxNP with CCxP) has no model."""
        self.value["CCER"] = value

    def read_cnt(self) -> int:
        """The counter."""
        return self.count()

    def write_cnt(self, value: int) -> None:
        """Sets the counter."""
        self.count()
        self._restart(value & self._top)

    def write_arr(self, value: int) -> None:
        """At once without ARPE, at the next update with it (17.3.1)."""
        now = self.count()
        self.value["ARR"] = value & self._top
        if not self.value["CR1"] & ARPE:
            self._arr = self.value["ARR"]
            if self._free_running:
                self._restart(now)

    def _read_capture(self, channel: int) -> int:
        """Reading CCRx clears CCxIF (17.4.5)."""
        self.value["SR"] &= ~(1 << channel)
        if self.value["DIER"] >> channel & 1:
            self._update_line()
        return self.value[f"CCR{channel}"]

    def read_ccr1(self) -> int:
        """Capture of channel 1."""
        return self._read_capture(1)

    def read_ccr2(self) -> int:
        """Capture of channel 2."""
        return self._read_capture(2)

    def read_ccr3(self) -> int:
        """Capture of channel 3."""
        return self._read_capture(3)

    def read_ccr4(self) -> int:
        """Capture of channel 4."""
        return self._read_capture(4)
