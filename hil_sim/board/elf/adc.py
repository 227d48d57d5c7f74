"""Analog-to-digital converters ADC1 and ADC2 (RM0390 chapter 13): single conversions of 12 bits.

Independent by software start, or in regular simultaneous dual mode by a timer's trigger, where both
convert in the same instant and one word with both results goes to the DMA. An injected conversion is started
by software, on both in dual mode. What is configured is here, the conversions are in adc.c.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.chip import CData, Registers, ffi, lib
from hil_sim.board.elf.registers import ALL, Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

EOCIE, OVRIE = 1 << 5, 1 << 26
ADON, DMA, DDS, EOCS, JSWSTART, SWSTART = 1 << 0, 1 << 8, 1 << 9, 1 << 10, 1 << 22, 1 << 30
TRIGGERS = {8: "TIM3"}  # EXTSEL 1000: TIM3_TRGO (13.6)
DUAL = (6, 1)  # MULTI: regular simultaneous mode, alone or with injected simultaneous mode (13.13.16)
DMA_MODE_2 = 2
COMMON = ("CSR", "CCR", "CDR")

Source = Callable[[int], int]


class Converter(Peripheral):
    """One ADC's own registers."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("SR", 0x00, "13.13.1", modelled=ALL),
        Register("CR1", 0x04, "13.13.2", modelled=EOCIE | OVRIE),
        Register("CR2", 0x08, "13.13.3", modelled=ADON | DMA | DDS | EOCS | JSWSTART | 0x3F00_0000 | SWSTART),
        Register("SMPR1", 0x0C, "13.13.4", modelled=0x07FF_FFFF),
        Register("SMPR2", 0x10, "13.13.5", modelled=0x3FFF_FFFF),
        Register("SQR1", 0x2C, "13.13.9"),  # L = 0: one conversion
        Register("SQR2", 0x30, "13.13.10"),
        Register("SQR3", 0x34, "13.13.11", modelled=0x1F),
        Register("JSQR", 0x38, "13.13.12", modelled=0x000F_8000),  # JL = 0: JSQ4 alone
        Register("JDR1", 0x3C, "13.13.13"),
        Register("DR", 0x4C, "13.13.14"),
    )

    def __init__(self, number: int, base: int, pair: "AdcPair") -> None:
        super().__init__(f"ADC{number + 1}", base, pair.soc)
        self.number = number
        self.pair = pair
        self.value = Registers(
            pair.shared.reg[number], {register.name: register.offset // 4 for register in self.REGISTERS}
        )

    def write_sr(self, value: int) -> None:
        """Flags are cleared by writing zeros."""
        self.value["SR"] &= value
        self.pair.update_line()

    def write_cr1(self, value: int) -> None:
        """Interrupt enables."""
        self.value["CR1"] = value
        self.pair.update_line()

    def read_cr2(self) -> int:
        """SWSTART and JSWSTART are cleared by hardware when the conversion starts."""
        return self.value["CR2"] & ~(SWSTART | JSWSTART)

    def write_cr2(self, value: int) -> None:
        """Power, trigger, DMA, software start."""
        selection, edges = value >> 24 & 0xF, value >> 28 & 3
        if edges and (edges != 1 or selection not in TRIGGERS):
            raise self.unmodelled("write", "CR2", 0x08, value & 0x3F00_0000)
        was_on = self.value["CR2"] & ADON
        if not value & DMA:
            self.pair.allow_requests()
        self.value["CR2"] = value & ~(SWSTART | JSWSTART)
        if value & (SWSTART | JSWSTART) and not was_on:
            raise self.violation("a start before ADON", "13.3.1")
        if value & SWSTART:
            lib.adc_start(self.pair.shared, self.number)
        if value & JSWSTART:
            lib.adc_start_injected(self.pair.shared, self.number)
        self.pair.listen()

    def read_dr(self) -> int:
        """Reading the result clears EOC."""
        return int(lib.adc_read_dr(self.pair.shared, self.number))


class AdcPair(Peripheral):
    """ADC1 as master, ADC2 as slave, and their common registers; ADC3 is not modelled."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("CSR", 0x300, "13.13.15"),
        Register("CCR", 0x304, "13.13.16", modelled=0x0083_E01F),
        Register("CDR", 0x308, "13.13.17"),
    )

    def __init__(self, base: int, soc: "Soc") -> None:
        super().__init__("ADC", base, soc)
        self.adc1 = Converter(0, base, self)
        self.adc2 = Converter(1, base + 0x100, self)
        self.source: Source = lambda _channel: 0
        self.listen()

    def _shared(self) -> CData:
        pair = ffi.new("adc *")
        lib.adc_bind(pair)
        return pair

    def _share(self) -> None:
        self._bind_bank()
        self.value = Registers(self.shared.common, {name: place for place, name in enumerate(COMMON)})

    def read(self, offset: int, size: int) -> int:
        """ADC1 from 0x000, ADC2 from 0x100, common registers from 0x300."""
        if offset < 0x200:
            return (self.adc1, self.adc2)[offset >> 8].read(offset & 0xFF, size)
        return super().read(offset, size)

    def write(self, offset: int, size: int, value: int) -> None:
        """As read."""
        if offset < 0x200:
            (self.adc1, self.adc2)[offset >> 8].write(offset & 0xFF, size, value)
        else:
            super().write(offset, size, value)

    def write_ccr(self, value: int) -> None:
        """Mode, DMA mode, clock and the internal reference."""
        if value & 0x1F not in (0, *DUAL) or value >> 14 & 3 not in (0, DMA_MODE_2):
            raise self.unmodelled("write", "CCR", 0x304, value)
        self.value["CCR"] = value
        if not value >> 14 & 3:
            self.allow_requests()

    def allow_requests(self) -> None:
        """DMA switched off: when it comes on again, requests begin anew (13.8.1)."""
        self.shared.requests_over = 0

    def held_after_s(self, channel: int) -> float:
        """From the trigger to the instant whose voltage counts: the end of sampling, in seconds."""
        return float(lib.adc_held_after_s(self.shared, channel))

    def listen(self) -> None:
        """Whose trigger output starts conversions."""
        cr2 = self.adc1.value["CR2"]
        timer = TRIGGERS.get(cr2 >> 24 & 0xF) if cr2 & ADON and cr2 >> 28 & 3 else None
        self.shared.trigger = -1 if timer is None else getattr(lib, timer)

    def next_trigger(self) -> int | None:
        """The cycle at which the timer will trigger the next conversion, if it runs."""
        cr2 = self.adc1.value["CR2"]
        if not cr2 & ADON or not cr2 >> 28 & 3:
            return None
        return self.soc.timers[TRIGGERS[cr2 >> 24 & 0xF]].next_update()

    def read_csr(self) -> int:
        """Copies of both status registers."""
        return self.adc1.value["SR"] | self.adc2.value["SR"] << 8

    def read_cdr(self) -> int:
        """Both results; reading clears EOC of both."""
        return int(lib.adc_read_cdr(self.shared))

    def update_line(self) -> None:
        """One interrupt for all converters."""
        lib.adc_update_line(self.shared)
