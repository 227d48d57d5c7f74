"""Register banks that know their manual and refuse everything else.

A model lists its registers as rows: name, offset, section of the manual, value after reset, and the bits that
the model gives a meaning to. Writing any other bit differently from its reset value, touching an offset
that is no row, or using another width than the manual allows, raises `UnmodelledAccess`. Status registers
whose flags are cleared by writing zeros take ones anywhere: that is how one flag is cleared alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.errors import RuleViolation, UnmodelledAccess

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

ALL = 0xFFFF_FFFF


@dataclass(frozen=True)
class Register:
    """A row of a register map.

    Attributes:
        name: as in the reference manual, without the peripheral's name.
        offset: from the peripheral's base address, bytes.
        section: of RM0390 (or PM0214 for the processor's own), where it is described.
        reset: value after reset.
        modelled: bits that may be written with either value.
    """

    name: str
    offset: int
    section: str
    reset: int = 0
    modelled: int = 0


class Peripheral:
    """A register bank on the bus.

    A subclass lists REGISTERS and adds `read_<name>` and `write_<name>` where a register is more than
    storage. `value` holds what plain registers hold, by name.
    """

    REGISTERS: ClassVar[tuple[Register, ...]] = ()
    WIDTHS: ClassVar[tuple[int, ...]] = (4,)

    def __init__(self, name: str, base: int, soc: "Soc") -> None:
        self.name = name
        self.base = base
        self.soc = soc
        self.value = {register.name: register.reset for register in self.REGISTERS}
        self._readers: dict[int, tuple[Register, Callable[[], int] | None]] = {}
        self._writers: dict[int, tuple[Register, Callable[[int], None] | None]] = {}
        for register in self.REGISTERS:
            suffix = register.name.lower()
            self._readers[register.offset] = (register, getattr(self, f"read_{suffix}", None))
            self._writers[register.offset] = (register, getattr(self, f"write_{suffix}", None))

    def read(self, offset: int, size: int) -> int:
        """A bus read of `size` bytes."""
        row = self._readers.get(offset)
        if row is None or size not in self.WIDTHS:
            raise self.unmodelled("read", "?", offset, (1 << (8 * size)) - 1)
        register, reader = row
        return self.value[register.name] if reader is None else reader()

    def write(self, offset: int, size: int, value: int) -> None:
        """A bus write of `size` bytes."""
        row = self._writers.get(offset)
        if row is None or size not in self.WIDTHS:
            raise self.unmodelled("write", "?", offset, value)
        register, writer = row
        strange = (value ^ register.reset) & ~register.modelled & ALL
        if strange:
            raise self.unmodelled("write", register.name, offset, strange)
        if writer is None:
            self.value[register.name] = value
        else:
            writer(value)

    def unmodelled(self, what: str, register: str, offset: int, bits: int) -> UnmodelledAccess:
        """The error for an access that no model covers."""
        return UnmodelledAccess(what, self.name, register, self.base + offset, bits, self.soc.pc)

    def violation(self, rule: str, section: str) -> RuleViolation:
        """The error for what the manual forbids."""
        return RuleViolation(self.name, rule, section, self.soc.pc)
