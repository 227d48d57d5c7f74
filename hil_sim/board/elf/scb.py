"""System control block (PM0214 4.4) and the floating point unit's context control (PM0214 4.6.2)."""

from typing import ClassVar

from hil_sim.board.elf.memory import FLASH_BASE
from hil_sim.board.elf.nvic import FIRST_IRQ, PENDSV, SYSTICK
from hil_sim.board.elf.registers import ALL, Peripheral, Register

VECTKEY = 0x05FA
VECTKEYSTAT = 0xFA05
PENDSTCLR, PENDSTSET, PENDSVCLR, PENDSVSET = 1 << 25, 1 << 26, 1 << 27, 1 << 28
SYSRESETREQ = 1 << 2
STACK_ALIGN = 1 << 9


class Scb(Peripheral):
    """Vector table, reset request, system priorities, fault status."""

    WIDTHS = (1, 2, 4)
    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("CPUID", 0xD00, "PM0214 4.4.2", reset=0x410F_C241),
        Register("ICSR", 0xD04, "PM0214 4.4.3", modelled=PENDSTCLR | PENDSTSET | PENDSVCLR | PENDSVSET),
        Register("VTOR", 0xD08, "PM0214 4.4.4", modelled=0x3FFF_FE00),
        Register("AIRCR", 0xD0C, "PM0214 4.4.5", modelled=0xFFFF_0000 | SYSRESETREQ | 0x0300),
        Register(
            "SCR", 0xD10, "PM0214 4.4.6"
        ),  # sleep only: no deep sleep, no sleep on exit, no event on pending
        Register("CCR", 0xD14, "PM0214 4.4.7", reset=STACK_ALIGN),
        Register("SHPR1", 0xD18, "PM0214 4.4.8", modelled=0x00F0_F0F0),
        Register("SHPR2", 0xD1C, "PM0214 4.4.8", modelled=0xF000_0000),
        Register("SHPR3", 0xD20, "PM0214 4.4.8", modelled=0xF0F0_0000),
        Register("SHCSR", 0xD24, "PM0214 4.4.9", modelled=0x0007_0000),
        Register("CFSR", 0xD28, "PM0214 4.4.10", modelled=ALL),
        Register("HFSR", 0xD2C, "PM0214 4.4.14", modelled=ALL),
        Register("MMFAR", 0xD34, "PM0214 4.4.15"),
        Register("BFAR", 0xD38, "PM0214 4.4.16"),
        Register("CPACR", 0xD88, "PM0214 4.6.1", modelled=0x00F0_0000),
        Register("FPCCR", 0xF34, "PM0214 4.6.2", reset=0xC000_0000),  # automatic and lazy, as after reset
    )

    def read_icsr(self) -> int:
        """VECTACTIVE, VECTPENDING, RETTOBASE, ISRPENDING and the two pending bits."""
        nvic = self.soc.nvic
        active = nvic.active[-1] if nvic.active else 0
        waiting = sorted((nvic.priority_of(n), n) for n in nvic.pending if n in nvic.enabled)
        value = active | (waiting[0][1] << 12 if waiting else 0) | (len(nvic.active) <= 1) << 11
        value |= any(number >= FIRST_IRQ for number in nvic.pending) << 22
        return value | (SYSTICK in nvic.pending) << 26 | (PENDSV in nvic.pending) << 28

    def write_icsr(self, value: int) -> None:
        """Sets or clears PendSV and SysTick."""
        pending = self.soc.nvic.pending
        pending -= {SYSTICK} if value & PENDSTCLR else set()
        pending -= {PENDSV} if value & PENDSVCLR else set()
        if value & PENDSTSET:
            self.soc.nvic.pend(SYSTICK)
        if value & PENDSVSET:
            self.soc.nvic.pend(PENDSV)

    def write_vtor(self, value: int) -> None:
        """Where the vectors are."""
        self.value["VTOR"] = value
        self.soc.chip.vectors = value or FLASH_BASE  # address 0 is an alias of the flash (RM0390 2.4)

    def read_aircr(self) -> int:
        """The key reads back inverted in meaning (0xFA05)."""
        return VECTKEYSTAT << 16 | self.value["AIRCR"] & 0x0300

    def write_aircr(self, value: int) -> None:
        """Ignored without the key; SYSRESETREQ resets the system."""
        if value >> 16 != VECTKEY:
            return
        self.value["AIRCR"] = value & 0x0300
        if value & SYSRESETREQ:
            self.soc.request_reset("software")

    def write_cfsr(self, value: int) -> None:
        """Bits are cleared by writing ones."""
        self.value["CFSR"] &= ~value

    def write_hfsr(self, value: int) -> None:
        """Bits are cleared by writing ones."""
        self.value["HFSR"] &= ~value

    def _store_priorities(self, register: str, first: int, value: int) -> None:
        self.value[register] = value
        self.soc.nvic.priority[first : first + 4] = list(value.to_bytes(4, "little"))
        self.soc.interrupts_changed()

    def write_shpr1(self, value: int) -> None:
        """Memory management fault, bus fault, usage fault."""
        self._store_priorities("SHPR1", 4, value)

    def write_shpr2(self, value: int) -> None:
        """SVCall."""
        self._store_priorities("SHPR2", 8, value)

    def write_shpr3(self, value: int) -> None:
        """PendSV and SysTick."""
        self._store_priorities("SHPR3", 12, value)

    @property
    def fpu_enabled(self) -> bool:
        """CP10 and CP11 have full access."""
        return self.value["CPACR"] == 0x00F0_0000
