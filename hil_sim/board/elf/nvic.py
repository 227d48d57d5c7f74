"""Nested vectored interrupt controller (PM0214 4.3): its registers, and what nvic.c knows of its state.

Interrupts are level-sensitive here (PM0214 4.3.9): a line that is still high when its handler returns makes
the interrupt pending again. All four priority bits preempt (PRIGROUP up to 3).
"""

from typing import TYPE_CHECKING

from hil_sim.board.elf.chip import BitSet, CData, lib
from hil_sim.board.elf.registers import Peripheral

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

IRQS = 97  # RM0390 10.1.3, table of vectors
NMI = 2
PENDSV = 14
SYSTICK = 15
FIRST_IRQ = 16

ISER, ICER, ISPR, ICPR, IABR, IPR = 0x100, 0x180, 0x200, 0x280, 0x300, 0x400
WORDS = (IRQS + 31) // 32


class Nvic(Peripheral):
    """Which exception runs, which wait, and which may enter.

    Exceptions are numbered as in the vector table: interrupt n is exception 16 + n.
    """

    def __init__(self, base: int, soc: "Soc") -> None:
        super().__init__("NVIC", base, soc)
        chip = soc.chip
        self.priority: CData = chip.priority
        self.enabled = BitSet(chip.enabled)
        self.pending = BitSet(chip.pending)
        for words in (chip.enabled, chip.pending, chip.lines):
            words[0:4] = [0, 0, 0, 0]
        chip.priority[0 : FIRST_IRQ + IRQS] = [0] * (FIRST_IRQ + IRQS)
        chip.enabled[0] = (1 << FIRST_IRQ) - 1
        chip.nested = 0

    @property
    def active(self) -> list[int]:
        """The exceptions under way, the one that runs last."""
        return list(self.soc.chip.active[0 : self.soc.chip.nested])

    def pend(self, exception: int) -> None:
        """Makes an exception pending."""
        lib.nvic_pend(self.soc.chip, exception)

    def set_line(self, irq: int, high: bool) -> None:
        """A peripheral's interrupt line changes to, or stays at, a level."""
        lib.nvic_set_line(self.soc.chip, irq, high)

    def priority_of(self, exception: int) -> int:
        """Lower is more urgent."""
        return int(lib.nvic_priority(self.soc.chip, exception))

    # --- registers, PM0214 4.3.2 to 4.3.7: one bit (or, in IPR, one byte) an interrupt -----------------

    def read(self, offset: int, size: int) -> int:
        """ISER, ICER, ISPR, ICPR, IABR by words; IPR by bytes or words."""
        for first, members in ((ISER, self.enabled), (ICER, self.enabled), (ISPR, self.pending),
                               (ICPR, self.pending), (IABR, set(self.active))):  # fmt: skip
            if first <= offset < first + 4 * WORDS and size == 4:
                base = FIRST_IRQ + 8 * (offset - first)
                return sum(1 << bit for bit in range(32) if base + bit in members)
        if offset >= IPR and offset + size <= IPR + IRQS:
            first = FIRST_IRQ + offset - IPR
            return int.from_bytes(bytes(list(self.priority[first : first + size])), "little")
        raise self.unmodelled("read", "?", offset, (1 << (8 * size)) - 1)

    def write(self, offset: int, size: int, value: int) -> None:
        """Ones set or clear; zeros do nothing (PM0214 4.3.2)."""
        if offset >= IPR and offset + size <= IPR + IRQS:
            for index, byte in enumerate(value.to_bytes(size, "little")):
                if byte & 0x0F:
                    raise self.unmodelled("write", "IPR", offset, value)  # only bits 7:4 exist
                self.priority[FIRST_IRQ + offset - IPR + index] = byte
        elif size == 4 and ISER <= offset < IABR and (offset & 0x7F) < 4 * WORDS:
            base = FIRST_IRQ + 8 * (offset & 0x7F)
            numbers = {base + bit for bit in range(32) if value >> bit & 1}
            if any(number >= FIRST_IRQ + IRQS for number in numbers):
                raise self.unmodelled("write", "?", offset, value)
            self._set_or_clear(offset & ~0x7F, numbers)
        else:
            raise self.unmodelled("write", "?", offset, value)
        self.soc.interrupts_changed()

    def _set_or_clear(self, register: int, numbers: set[int]) -> None:
        if register == ISER:
            chosen, add = self.enabled, True
        elif register == ICER:
            chosen, add = self.enabled, False
        elif register == ISPR:
            chosen, add = self.pending, True
        else:
            chosen, add = self.pending, False
            numbers = numbers - set(BitSet(self.soc.chip.lines))
        for number in numbers:
            (chosen.add if add else chosen.discard)(number)
