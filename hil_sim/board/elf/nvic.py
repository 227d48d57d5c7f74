"""Nested vectored interrupt controller (PM0214 4.3) and the rules of priority (PM0214 2.3.5, 2.3.6).

Interrupts are level-sensitive here (PM0214 4.3.9): a line that is still high when its handler returns makes
the interrupt pending again. All four priority bits preempt (PRIGROUP up to 3).
"""

from typing import TYPE_CHECKING

from hil_sim.board.elf.registers import Peripheral

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

IRQS = 97  # RM0390 10.1.3, table of vectors
NMI = 2
HARD_FAULT = 3
PENDSV = 14
SYSTICK = 15
FIRST_IRQ = 16
THREAD = 256  # lower than every priority
FIXED = {NMI: -2, HARD_FAULT: -1}

ISER, ICER, ISPR, ICPR, IABR, IPR = 0x100, 0x180, 0x200, 0x280, 0x300, 0x400
WORDS = (IRQS + 31) // 32


class Nvic(Peripheral):
    """Which exception runs, which wait, and which may enter.

    Exceptions are numbered as in the vector table: interrupt n is exception 16 + n.
    """

    def __init__(self, base: int, soc: "Soc") -> None:
        super().__init__("NVIC", base, soc)
        self.priority = [0] * (FIRST_IRQ + IRQS)
        self.enabled = set(range(FIRST_IRQ))
        self.pending: set[int] = set()
        self.lines: set[int] = set()
        self.active: list[int] = []

    def pend(self, exception: int) -> None:
        """Makes an exception pending."""
        self.pending.add(exception)
        self.soc.interrupts_changed()

    def set_line(self, irq: int, high: bool) -> None:
        """A peripheral's interrupt line changes to, or stays at, a level."""
        exception = FIRST_IRQ + irq
        if not high:
            self.lines.discard(exception)
        elif exception not in self.lines:
            self.lines.add(exception)
            self.pend(exception)

    def priority_of(self, exception: int) -> int:
        """Lower is more urgent."""
        return FIXED.get(exception, self.priority[exception])

    def execution_priority(self) -> int:
        """The most urgent of the exceptions under way; THREAD without any (masks not counted)."""
        return min((self.priority_of(number) for number in self.active), default=THREAD)

    def candidate(self) -> int | None:
        """The pending exception that would enter next but for masks; of equals the lower number."""
        if not self.pending:
            return None
        ready = [(self.priority_of(n), n) for n in self.pending if n in self.enabled]
        if not ready:
            return None
        priority, number = min(ready)
        return number if priority < self.execution_priority() else None

    def enter(self, exception: int) -> None:
        """The processor takes an exception."""
        self.pending.discard(exception)
        self.active.append(exception)

    def leave(self, exception: int) -> None:
        """The handler has returned."""
        self.active.remove(exception)
        if exception in self.lines:
            self.pending.add(exception)

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
            return int.from_bytes(bytes(self.priority[first : first + size]), "little")
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
            self.enabled |= numbers
        elif register == ICER:
            self.enabled -= numbers
        elif register == ISPR:
            self.pending |= numbers
        else:
            self.pending -= numbers - self.lines
