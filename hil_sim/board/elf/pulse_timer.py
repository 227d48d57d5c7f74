"""The advanced timer (RM0390 chapter 16) as far as one output needs it: channel 2 in PWM mode 2.

Its counter is not run: started by TIM4's trigger together with TIM3, it stands in a fixed relation to the
triggers, from which `rise_s` is worked out. Whatever else a program does with it is refused.
"""

from typing import ClassVar

from hil_sim.board.elf.registers import ALL, Peripheral, Register

PWM_2, CC2E, MOE = 7 << 12, 1 << 4, 1 << 15
TRIGGERED_BY_TIM4 = 3 << 4 | 6  # TS = ITR3 (16.4.3), SMS = trigger mode


class PulseTimer(Peripheral):
    """TIM1."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("CR1", 0x00, "16.4.1"),
        Register("CR2", 0x04, "16.4.2"),
        Register("SMCR", 0x08, "16.4.3", modelled=0x0077),
        Register("EGR", 0x14, "16.4.6", modelled=1),
        Register("CCMR1", 0x18, "16.4.7", modelled=PWM_2),
        Register("CCER", 0x20, "16.4.9", modelled=CC2E),
        Register("PSC", 0x28, "16.4.11", modelled=0xFFFF),
        Register("ARR", 0x2C, "16.4.12", reset=0xFFFF, modelled=ALL),
        Register("CCR2", 0x38, "16.4.15", modelled=0xFFFF),
        Register("BDTR", 0x44, "16.4.18", modelled=MOE),
    )
    WIDTHS = (2, 4)

    def write_egr(self, _value: int) -> None:
        """UG: prescaler and limits take effect, the counter starts from 0 (16.4.6)."""
        self._prescaler = self.value["PSC"]

    def write_smcr(self, value: int) -> None:
        """Trigger mode on TIM4, or nothing."""
        if value not in (0, TRIGGERED_BY_TIM4):
            raise self.unmodelled("write", "SMCR", 0x08, value)
        self.value["SMCR"] = value

    _prescaler = 0  # in force; PSC itself is taken over at an update

    def rise_s(self) -> tuple[float, float] | None:
        """From TIM4's trigger to the first rise of the output, and its period; None: there is no output."""
        value = self.value
        on = value["CCMR1"] & PWM_2 == PWM_2 and value["CCER"] & CC2E and value["BDTR"] & MOE
        if not on or value["SMCR"] != TRIGGERED_BY_TIM4 or not self.soc.routed("TIM1_CH2"):
            return None
        count_s = (self._prescaler + 1) * self.soc.rcc.timer_divider(2) / self.soc.schedule.frequency
        return value["CCR2"] * count_s, (value["ARR"] + 1) * count_s
