"""System timer of the processor (PM0214 4.5)."""

from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.nvic import SYSTICK
from hil_sim.board.elf.registers import Peripheral, Register
from hil_sim.board.elf.schedule import Event

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

ENABLE, TICKINT, CLKSOURCE, COUNTFLAG = 1, 2, 4, 1 << 16


class SysTick(Peripheral):
    """A 24-bit down-counter that reloads: its period is LOAD + 1 cycles (AHB, or AHB/8)."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("CTRL", 0x10, "PM0214 4.5.1", modelled=ENABLE | TICKINT | CLKSOURCE),
        Register("LOAD", 0x14, "PM0214 4.5.2", modelled=0x00FF_FFFF),
        Register("VAL", 0x18, "PM0214 4.5.3", modelled=0xFFFF_FFFF),
    )

    def __init__(self, base: int, soc: "Soc") -> None:
        super().__init__("STK", base, soc)
        self._event: Event | None = None
        self._counted = False

    @property
    def _step(self) -> int:
        return 1 if self.value["CTRL"] & CLKSOURCE else 8

    def read_ctrl(self) -> int:
        """COUNTFLAG: the counter has reached 0 since the last read; reading clears it."""
        value = self.value["CTRL"] | (COUNTFLAG if self._counted else 0)
        self._counted = False
        return value

    def write_ctrl(self, value: int) -> None:
        """Starts from VAL 0, that is with a reload, or stops."""
        running = self._event is not None
        self.value["CTRL"] = value
        if value & ENABLE and not running:
            self._schedule(self.value["VAL"] or self.value["LOAD"] + 1)
        elif not value & ENABLE and self._event is not None:
            self.value["VAL"] = self.read_val()
            self._event.cancel()
            self._event = None

    def read_val(self) -> int:
        """What is left to count."""
        if self._event is None:
            return self.value["VAL"]
        left = -(-(self._event.cycle - self.soc.schedule.now) // self._step)
        return left if left <= self.value["LOAD"] else 0

    def write_val(self, _value: int) -> None:
        """Any write clears the counter and COUNTFLAG."""
        self._counted = False
        self.value["VAL"] = 0
        if self._event is not None:
            self._event.cancel()
            self._schedule(self.value["LOAD"] + 1)

    def _schedule(self, counts: int) -> None:
        self._event = self.soc.schedule.after(counts * self._step, self._zero)

    def _zero(self) -> None:
        self._counted = True
        if self.value["CTRL"] & TICKINT:
            self.soc.nvic.pend(SYSTICK)
        if self.value["LOAD"]:
            self._schedule(self.value["LOAD"] + 1)
        else:
            self._event = None
            self.value["CTRL"] &= ~ENABLE
