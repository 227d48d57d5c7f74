"""Reset and clock control (RM0390 chapter 6): oscillators, PLL, bus clocks, clock gates, reset flags."""

from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.nvic import NMI
from hil_sim.board.elf.registers import Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

HSI_HZ = 16e6
HSE_HZ = 8e6  # the ST-LINK's MCO on a Nucleo-F446RE
HSE_START_S = 2e-3  # data sheet, HSE oscillator characteristics: typical start-up time
PLL_LOCK_S = 200e-6  # data sheet, main PLL characteristics: lock time

HSION, HSIRDY = 1 << 0, 1 << 1
HSEON, HSERDY, HSEBYP, CSSON = 1 << 16, 1 << 17, 1 << 18, 1 << 19
PLLON, PLLRDY = 1 << 24, 1 << 25
CSSF, CSSC = 1 << 7, 1 << 23
LSION, LSIRDY, RMVF = 1 << 0, 1 << 1, 1 << 24
RESET_FLAGS = {
    "power": (1 << 25) | (1 << 26) | (1 << 27),  # BORRSTF, PINRSTF, PORRSTF (6.1.2, 6.3.21)
    "pin": 1 << 26,
    "brown_out": (1 << 25) | (1 << 26),
    "software": (1 << 26) | (1 << 28),
    "iwdg": (1 << 26) | (1 << 29),
}
# Table of maximum HCLK against wait states at 2.7 V to 3.6 V (RM0390 3.4.1).
WAIT_STATE_LIMIT_HZ = 30e6
# Clock gates: bus register and bit of each peripheral that has a model (6.3.10, 6.3.13, 6.3.14).
GATES = {
    "GPIOA": ("AHB1ENR", 0), "GPIOB": ("AHB1ENR", 1), "GPIOC": ("AHB1ENR", 2), "GPIOH": ("AHB1ENR", 7),
    "DMA1": ("AHB1ENR", 21), "DMA2": ("AHB1ENR", 22),
    "TIM2": ("APB1ENR", 0), "TIM3": ("APB1ENR", 1), "TIM4": ("APB1ENR", 2), "TIM5": ("APB1ENR", 3),
    "TIM12": ("APB1ENR", 6), "USART2": ("APB1ENR", 17), "CAN1": ("APB1ENR", 25), "PWR": ("APB1ENR", 28),
    "ADC1": ("APB2ENR", 8), "ADC2": ("APB2ENR", 9), "TIM1": ("APB2ENR", 0), "TIM11": ("APB2ENR", 18),
    "SPI2": ("APB1ENR", 14),
}  # fmt: skip


def _gate_mask(register: str) -> int:
    return sum(1 << bit for name, bit in GATES.values() if name == register)


class Rcc(Peripheral):
    """Clock tree of the chip; changes of the system clock go to the schedule."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register(
            "CR", 0x00, "6.3.1", 0x83, HSION | HSIRDY | HSEON | HSERDY | HSEBYP | CSSON | PLLON | PLLRDY
        ),
        Register("PLLCFGR", 0x04, "6.3.2", 0x2400_3010, 0x7F43_7FFF),
        Register("CFGR", 0x08, "6.3.3", 0, 0x001F_FCFF),
        Register("CIR", 0x0C, "6.3.4", 0, CSSC | CSSF),
        Register("AHB1ENR", 0x30, "6.3.10", 0, _gate_mask("AHB1ENR")),
        Register("APB1ENR", 0x40, "6.3.13", 0, _gate_mask("APB1ENR")),
        Register("APB2ENR", 0x44, "6.3.14", 0, _gate_mask("APB2ENR")),
        Register("CSR", 0x74, "6.3.21", 0, 0xFF00_0003),
    )

    def __init__(self, base: int, soc: "Soc", reset_cause: str) -> None:
        super().__init__("RCC", base, soc)
        self.hse_present = soc.hse_present
        self.hse_bypass = soc.hse_bypass
        self._hse_ready = False
        self._pll_ready = False
        self.value["CSR"] = soc.reset_flags | RESET_FLAGS[reset_cause]

    # --- frequencies --------------------------------------------------------------------------------

    def pll_hz(self) -> float:
        """VCO = input / PLLM * PLLN; output = VCO / PLLP (6.3.2).

        Raises:
            RuleViolation: a frequency outside the limits of 6.3.2.
        """
        config = self.value["PLLCFGR"]
        divider_m, factor_n = config & 0x3F, config >> 6 & 0x1FF
        divider_p = 2 * ((config >> 16 & 3) + 1)
        if config >> 24 & 0xF < 2:
            raise self.violation(f"PLLQ {config >> 24 & 0xF} is not allowed", "6.3.2")
        if divider_m < 2 or not 50 <= factor_n <= 432:
            raise self.violation(f"PLLM {divider_m} or PLLN {factor_n} is not allowed", "6.3.2")
        source = (HSE_HZ if config >> 22 & 1 else self.soc.hsi_hz) / divider_m
        if not 1e6 <= source <= 2e6 or not 100e6 <= source * factor_n <= 432e6:
            raise self.violation(f"VCO input {source} Hz or output {source * factor_n} Hz", "6.3.2")
        return source * factor_n / divider_p

    def sysclk_hz(self) -> float:
        """Frequency of the selected system clock."""
        source = self.value["CFGR"] & 3
        return self.soc.hsi_hz if source == 0 else HSE_HZ if source == 1 else self.pll_hz()

    def bus_divider(self, bus: int) -> int:
        """HCLK over PCLK1 or PCLK2 (6.3.3 PPRE1, PPRE2)."""
        code = self.value["CFGR"] >> (10 if bus == 1 else 13) & 7
        return 1 if code < 4 else 2 << (code - 4)

    def timer_divider(self, bus: int) -> int:
        """HCLK over the clock of the timers of a bus: PCLK if undivided, else twice PCLK (6.2)."""
        divider = self.bus_divider(bus)
        return 1 if divider == 1 else divider // 2

    def gated(self, peripheral: str) -> bool:
        """The peripheral has no clock."""
        register, bit = GATES[peripheral]
        return not self.value[register] >> bit & 1

    @property
    def hse_ready(self) -> bool:
        """The external clock runs."""
        return self._hse_ready

    # --- registers ----------------------------------------------------------------------------------

    def write(self, offset: int, size: int, value: int) -> None:
        """Any write may gate a clock."""
        super().write(offset, size, value)
        self.soc.gates_changed()

    def read_cr(self) -> int:
        """Ready bits follow their oscillator."""
        value = self.value["CR"] & ~(HSIRDY | HSERDY | PLLRDY)
        value |= HSIRDY if value & HSION else 0
        return value | (HSERDY if self._hse_ready else 0) | (PLLRDY if self._pll_ready else 0)

    def write_cr(self, value: int) -> None:
        """Switches oscillators; what is in use as system clock cannot be switched off (6.3.1)."""
        source = self.value["CFGR"] & 3
        old, self.value["CR"] = self.value["CR"], value
        if (not value & HSION and source == 0) or (not value & PLLON and source == 2):
            raise self.violation("the oscillator of the system clock was switched off", "6.3.1")
        if (old ^ value) & HSEBYP and old & HSEON:
            raise self.violation("HSEBYP written while HSE is on", "6.3.1")
        fits = self.hse_bypass is None or self.hse_bypass == bool(value & HSEBYP)
        if value & HSEON and not old & HSEON and self.hse_present and fits:
            self.soc.schedule.after_seconds(HSE_START_S, self._hse_starts)
        if not value & HSEON:
            self._hse_ready = False
        if value & PLLON and not old & PLLON:
            self.soc.schedule.after_seconds(PLL_LOCK_S, self._pll_locks)
        if not value & PLLON:
            self._pll_ready = False

    def _hse_starts(self) -> None:
        self._hse_ready = bool(self.value["CR"] & HSEON) and self.hse_present

    def _pll_locks(self) -> None:
        self._pll_ready = bool(self.value["CR"] & PLLON)

    def write_pllcfgr(self, value: int) -> None:
        """Writable only while the PLL is off (6.3.2)."""
        if self.value["CR"] & PLLON:
            raise self.violation("PLLCFGR written while the PLL is on", "6.3.2")
        self.value["PLLCFGR"] = value

    def read_cfgr(self) -> int:
        """SWS shows what SW selected."""
        value = self.value["CFGR"]
        return value & ~0xC | (value & 3) << 2

    def write_cfgr(self, value: int) -> None:
        """Selects the system clock and the prescalers of the buses."""
        source = value & 3
        if value & 0xF0:
            raise self.unmodelled("write", "CFGR", 0x08, value & 0xF0)  # HPRE: HCLK is SYSCLK here
        ready = (True, self._hse_ready, self._pll_ready, False)[source]
        if not ready:
            raise self.violation(f"system clock {source} selected before it is ready", "6.3.3")
        self.value["CFGR"] = value & ~0xC
        self._check_limits()
        self.soc.clocks_changed(self.sysclk_hz())

    def _check_limits(self) -> None:
        hclk = self.sysclk_hz()
        if hclk > WAIT_STATE_LIMIT_HZ * (self.soc.flash.latency + 1):
            raise self.violation(f"{self.soc.flash.latency} flash wait states at {hclk} Hz", "3.4.1")
        if hclk / self.bus_divider(1) > 45e6 or hclk / self.bus_divider(2) > 90e6:
            raise self.violation("APB1 above 45 MHz or APB2 above 90 MHz", "6.2")
        if hclk > self.soc.pwr.limit_hz:
            raise self.violation(f"{hclk} Hz is too fast for this regulator scale", "5.1.3")

    def read_cir(self) -> int:
        """CSSF."""
        return self.value["CIR"] & CSSF

    def write_cir(self, value: int) -> None:
        """CSSC clears CSSF."""
        if value & CSSC:
            self.value["CIR"] &= ~CSSF

    def read_csr(self) -> int:
        """Reset flags, and LSIRDY with LSION."""
        value = self.value["CSR"]
        return value | (LSIRDY if value & LSION else 0)

    def write_csr(self, value: int) -> None:
        """RMVF clears the reset flags."""
        flags = 0 if value & RMVF else self.value["CSR"] & 0xFE00_0000
        self.soc.reset_flags = flags
        self.value["CSR"] = flags | value & LSION

    # --- faults from outside ------------------------------------------------------------------------

    def lose_hse(self) -> None:
        """The external clock stops. With CSS on: HSI takes over and an NMI comes (6.2.7)."""
        self.hse_present = self._hse_ready = self.soc.hse_present = False
        cr = self.value["CR"]
        uses_hse = self.value["CFGR"] & 3 == 1 or (
            self.value["CFGR"] & 3 == 2 and self.value["PLLCFGR"] >> 22 & 1
        )
        if not cr & CSSON:
            if uses_hse:
                raise self.violation("the system clock stopped and CSS is off", "6.2.7")
            return
        self.value["CR"] = cr & ~(HSEON | (PLLON if self.value["PLLCFGR"] >> 22 & 1 else 0))
        self._pll_ready = self._pll_ready and bool(self.value["CR"] & PLLON)
        if uses_hse:
            self.value["CFGR"] &= ~3
            self.soc.clocks_changed(self.soc.hsi_hz)
        self.value["CIR"] |= CSSF
        self.soc.nvic.pend(NMI)
