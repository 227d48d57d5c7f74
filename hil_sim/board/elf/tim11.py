"""TIM11 as a counter of the external clock (RM0390 6.2.11, chapter 18): channel 1 captures every n-th period
of HSE_RTC, which is HSE divided by RTCPRE. The counter has the timer clock of APB2. No other use is modelled.
"""

from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.rcc import HSE_HZ
from hil_sim.board.elf.registers import ALL, Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

CEN, CC1E, CC1IF, CC1OF = 1 << 0, 1 << 0, 1 << 1, 1 << 9
CAPTURES_INPUT, HSE_RTC = 1, 2


class Tim11(Peripheral):
    """Captures are worked out when somebody looks."""

    WIDTHS = (2, 4)
    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("CR1", 0x00, "18.5.1", modelled=CEN),
        Register("SR", 0x10, "18.5.3", modelled=ALL),
        Register("CCMR1", 0x18, "18.5.5", modelled=0x0D),  # CC1S = 01, IC1PSC; no filter
        Register("CCER", 0x20, "18.5.6", modelled=CC1E),
        Register("CNT", 0x24, "18.5.7"),
        Register("ARR", 0x2C, "18.5.9", 0xFFFF),
        Register("CCR1", 0x34, "18.5.10"),
        Register("OR", 0x50, "18.5.11", modelled=3),
    )

    def __init__(self, base: int, soc: "Soc") -> None:
        super().__init__("TIM11", base, soc)
        self._began: float | None = None
        self._captures = 0  # seen so far

    def _period_s(self) -> float | None:
        """From capture to capture; None where nothing is captured."""
        mode = self.value["CCMR1"]
        listens = mode & 3 == CAPTURES_INPUT and self.value["CCER"] & CC1E and self.value["OR"] == HSE_RTC
        divider = self.soc.rcc.value["CFGR"] >> 16 & 0x1F
        if not listens or divider < 2 or not self.soc.rcc.hse_ready:
            return None
        return divider * (1 << (mode >> 2 & 3)) / HSE_HZ

    def _look(self) -> None:
        period = self._period_s()
        if self._began is None or period is None:
            return
        captures = int((self.soc.schedule.seconds() - self._began) / period)
        if captures > self._captures:
            flags = self.value["SR"]
            missed = captures - self._captures > 1 or bool(flags & CC1IF)
            self.value["SR"] = flags | CC1IF | (CC1OF if missed else 0)
            self.value["CCR1"] = int(captures * period * self.soc.schedule.frequency) & 0xFFFF
            self._captures = captures

    def write_cr1(self, value: int) -> None:
        """CEN starts the counter at 0."""
        self.value["CR1"] = value
        self._began = self.soc.schedule.seconds() if value & CEN else None
        self._captures = 0

    def read_sr(self) -> int:
        """CC1IF, CC1OF."""
        self._look()
        return self.value["SR"]

    def write_sr(self, value: int) -> None:
        """Flags are cleared by writing zeros."""
        self.value["SR"] &= value

    def read_ccr1(self) -> int:
        """Reading clears CC1IF (18.5.3)."""
        self._look()
        self.value["SR"] &= ~CC1IF
        return self.value["CCR1"]
