"""Analog-to-digital converters ADC1 and ADC2 (RM0390 chapter 13): single regular conversions of 12 bits.

Independent by software start, or in regular simultaneous dual mode by a timer's trigger, where both
convert in the same instant and one word with both results goes to the DMA.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.registers import ALL, Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

EOC, STRT, OVR = 1 << 1, 1 << 4, 1 << 5
EOCIE, OVRIE = 1 << 5, 1 << 26
ADON, DMA, DDS, EOCS, SWSTART = 1 << 0, 1 << 8, 1 << 9, 1 << 10, 1 << 30
SAMPLE_CYCLES = (3, 15, 28, 56, 84, 112, 144, 480)  # 13.13.4
CONVERSION_CYCLES = 12  # 12 bits (13.5)
MAX_CLOCK_HZ = 36e6  # data sheet, ADC characteristics, VDDA above 2.4 V
ADC_IRQ = 18
TRIGGERS = {8: "TIM3"}  # EXTSEL 1000: TIM3_TRGO (13.6)
SIMULTANEOUS = 6  # MULTI 00110: regular simultaneous mode only (13.13.16)
DMA_MODE_2 = 2
CCR_DDS, TSVREFE = 1 << 13, 1 << 23
INTERNAL_CHANNELS = (17, 18)  # reference and temperature sensor, behind TSVREFE (13.10)
INTERNAL_SAMPLING_S = (
    10e-6  # data sheet, embedded reference voltage and temperature sensor: shortest sampling
)

Source = Callable[[int], int]


class Converter(Peripheral):
    """One ADC's own registers."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("SR", 0x00, "13.13.1", modelled=ALL),
        Register("CR1", 0x04, "13.13.2", modelled=EOCIE | OVRIE),
        Register("CR2", 0x08, "13.13.3", modelled=ADON | DMA | DDS | EOCS | 0x3F00_0000 | SWSTART),
        Register("SMPR1", 0x0C, "13.13.4", modelled=0x07FF_FFFF),
        Register("SMPR2", 0x10, "13.13.5", modelled=0x3FFF_FFFF),
        Register("SQR1", 0x2C, "13.13.9"),  # L = 0: one conversion
        Register("SQR2", 0x30, "13.13.10"),
        Register("SQR3", 0x34, "13.13.11", modelled=0x1F),
        Register("DR", 0x4C, "13.13.14"),
    )

    def __init__(self, name: str, base: int, pair: "AdcPair") -> None:
        super().__init__(name, base, pair.soc)
        self.pair = pair

    @property
    def channel(self) -> int:
        """The one channel of the sequence."""
        return self.value["SQR3"] & 0x1F

    def conversion_cycles(self) -> int:
        """Sampling plus conversion, in cycles of the ADC clock (13.5)."""
        return self.sample_cycles() + CONVERSION_CYCLES

    def sample_cycles(self) -> int:
        """Sampling alone, at whose end the voltage is held (13.5)."""
        register, place = ("SMPR1", self.channel - 10) if self.channel >= 10 else ("SMPR2", self.channel)
        return SAMPLE_CYCLES[self.value[register] >> 3 * place & 7]

    def write_sr(self, value: int) -> None:
        """Flags are cleared by writing zeros."""
        self.value["SR"] &= value
        self.pair.update_line()

    def write_cr1(self, value: int) -> None:
        """Interrupt enables."""
        self.value["CR1"] = value
        self.pair.update_line()

    def read_cr2(self) -> int:
        """SWSTART is cleared by hardware when the conversion starts."""
        return self.value["CR2"] & ~SWSTART

    def write_cr2(self, value: int) -> None:
        """Power, trigger, DMA, software start."""
        selection, edges = value >> 24 & 0xF, value >> 28 & 3
        if edges and (edges != 1 or selection not in TRIGGERS):
            raise self.unmodelled("write", "CR2", 0x08, value & 0x3F00_0000)
        was_on = self.value["CR2"] & ADON
        if not value & DMA:
            self.pair.allow_requests()
        self.value["CR2"] = value & ~SWSTART
        if value & SWSTART:
            if not was_on:
                raise self.violation("SWSTART before ADON", "13.3.1")
            self.pair.start(self)

    def read_dr(self) -> int:
        """Reading the result clears EOC."""
        self.value["SR"] &= ~EOC
        self.pair.update_line()
        return self.value["DR"]


class AdcPair(Peripheral):
    """ADC1 as master, ADC2 as slave, and their common registers; ADC3 is not modelled."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("CSR", 0x300, "13.13.15"),
        Register("CCR", 0x304, "13.13.16", modelled=0x0083_E01F),
        Register("CDR", 0x308, "13.13.17"),
    )

    def __init__(self, base: int, soc: "Soc") -> None:
        super().__init__("ADC", base, soc)
        self.adc1 = Converter("ADC1", base, self)
        self.adc2 = Converter("ADC2", base + 0x100, self)
        self.source: Source = lambda _channel: 0
        self._busy_until = -1
        self._overrun = False
        self._requests_over = False  # the DMA's last transfer has been, and DDS is 0

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

    @property
    def dual(self) -> bool:
        """Both convert together."""
        return self.value["CCR"] & 0x1F == SIMULTANEOUS

    @property
    def clock_divider(self) -> int:
        """HCLK over the ADC clock: PCLK2 divided by ADCPRE (13.13.16)."""
        divider = self.soc.rcc.bus_divider(2) * 2 * ((self.value["CCR"] >> 16 & 3) + 1)
        if self.soc.schedule.frequency / divider > MAX_CLOCK_HZ:
            raise self.violation("the ADC clock is above 36 MHz", "13.13.16")
        return divider

    def write_ccr(self, value: int) -> None:
        """Mode, DMA mode, clock and the internal reference."""
        if value & 0x1F not in (0, SIMULTANEOUS) or value >> 14 & 3 not in (0, DMA_MODE_2):
            raise self.unmodelled("write", "CCR", 0x304, value)
        self.value["CCR"] = value
        if not value >> 14 & 3:
            self.allow_requests()

    def allow_requests(self) -> None:
        """DMA switched off: when it comes on again, requests begin anew (13.8.1)."""
        self._requests_over = False

    def held_after_s(self, channel: int) -> float:
        """From the trigger to the instant whose voltage counts: the end of sampling, in seconds."""
        unit = self.adc1 if channel == self.adc1.channel else self.adc2
        return unit.sample_cycles() * self.clock_divider / self.soc.schedule.frequency

    def _check_internal(self, unit: Converter) -> None:
        if unit.channel not in INTERNAL_CHANNELS:
            return
        if not self.value["CCR"] & TSVREFE:
            raise self.violation(f"internal channel {unit.channel} converted while TSVREFE is 0", "13.10")
        if self.held_after_s(unit.channel) < INTERNAL_SAMPLING_S:
            raise self.violation(f"internal channel {unit.channel} sampled for less than 10 us", "13.10")

    def next_trigger(self) -> int | None:
        """The cycle at which the timer will trigger the next conversion, if it runs."""
        cr2 = self.adc1.value["CR2"]
        if not cr2 & ADON or not cr2 >> 28 & 3:
            return None
        return self.soc.timers[TRIGGERS[cr2 >> 24 & 0xF]].next_update()

    def trigger(self, timer: str) -> None:
        """A timer's TRGO rises."""
        cr2 = self.adc1.value["CR2"]
        if cr2 & ADON and cr2 >> 28 & 3 and TRIGGERS[cr2 >> 24 & 0xF] == timer:
            self.start(self.adc1)

    def start(self, master: Converter) -> None:
        """Samples now; the result comes after sampling and conversion. A trigger meanwhile is ignored."""
        now = self.soc.schedule.now
        if now < self._busy_until:
            return
        both = self.dual and master is self.adc1
        if both and not self.adc2.value["CR2"] & ADON:
            raise self.violation("dual mode with ADC2 off", "13.9")
        length = master.conversion_cycles()
        if both and length != self.adc2.conversion_cycles():
            raise self.violation("simultaneous conversions of different length", "13.9.2")
        self._check_internal(master)
        self._busy_until = now + length * self.clock_divider
        master.value["SR"] |= STRT
        first = self.source(master.channel)
        second = self.source(self.adc2.channel) if both else None
        self.soc.schedule.at(self._busy_until, lambda: self._finish(master, first, second))

    def _finish(self, master: Converter, first: int, second: int | None) -> None:
        """Results, EOC, DMA request; a result that was not fetched in time is an overrun (13.8.2)."""
        uses_dma = (
            bool(self.value["CCR"] >> 14 & 3) if second is not None else bool(master.value["CR2"] & DMA)
        ) and not self._requests_over
        if (uses_dma or master.value["CR2"] & EOCS) and master.value["SR"] & EOC:
            master.value["SR"] |= OVR
            self._overrun = uses_dma
        if self._overrun and master.value["SR"] & OVR:
            self.update_line()
            return  # no more requests until OVR is cleared
        self._overrun = False
        master.value["DR"] = first
        master.value["SR"] |= EOC
        if second is not None:
            self.adc2.value["DR"] = second
            self.adc2.value["SR"] |= EOC
            self.value["CDR"] = second << 16 | first
        if uses_dma:
            self._request(self.value["CCR"] & CCR_DDS if second is not None else master.value["CR2"] & DDS)
        self.update_line()

    def _request(self, endless: int) -> None:
        """After the DMA's last transfer, circular or not, a converter without DDS asks no more (13.8.1)."""
        if self.soc.dma_request("ADC1") and not endless and self.soc.dma_block_ended("ADC1"):
            self._requests_over = True

    def read_csr(self) -> int:
        """Copies of both status registers."""
        return self.adc1.value["SR"] | self.adc2.value["SR"] << 8

    def read_cdr(self) -> int:
        """Both results; reading clears EOC of both."""
        self.adc1.value["SR"] &= ~EOC
        self.adc2.value["SR"] &= ~EOC
        return self.value["CDR"] & ALL

    def update_line(self) -> None:
        """One interrupt for all converters."""
        high = any(
            (unit.value["SR"] & EOC and unit.value["CR1"] & EOCIE)
            or (unit.value["SR"] & OVR and unit.value["CR1"] & OVRIE)
            for unit in (self.adc1, self.adc2)
        )
        self.soc.nvic.set_line(ADC_IRQ, high)
