"""Register banks that know their manual and refuse everything else.

A model lists its registers as rows: name, offset, section of the manual, value after reset, and the bits that
the model gives a meaning to. Writing any other bit differently from its reset value, touching an offset
that is no row, or using another width than the manual allows, raises `UnmodelledAccess`. Status registers
whose flags are cleared by writing zeros take ones anywhere: that is how one flag is cleared alone.
"""

from collections.abc import Callable, MutableMapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.chip import CData, Registers, ffi
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
    storage. `value` holds what plain registers hold, by name. A model whose busy part is in C overrides
    `_shared`; that part is asked first, and Python answers the rest.
    """

    REGISTERS: ClassVar[tuple[Register, ...]] = ()
    WIDTHS: ClassVar[tuple[int, ...]] = (4,)

    def __init__(self, name: str, base: int, soc: "Soc") -> None:
        self.name = name
        self.base = base
        self.soc = soc
        self.shared: CData = self._shared()
        self.value: MutableMapping[str, int] = {register.name: register.reset for register in self.REGISTERS}
        if self.shared is not None:
            self._share()
        self._readers: dict[int, tuple[Register, Callable[[], int] | None]] = {}
        self._writers: dict[int, tuple[Register, Callable[[int], None] | None]] = {}
        for register in self.REGISTERS:
            suffix = register.name.lower()
            self._readers[register.offset] = (register, getattr(self, f"read_{suffix}", None))
            self._writers[register.offset] = (register, getattr(self, f"write_{suffix}", None))

    def _shared(self) -> CData:
        """The model's C struct: registers in `reg` by offset / 4, and a `bank`; None without one."""
        return None

    def _share(self) -> None:
        self._bind_bank()
        registers = Registers(self.shared.reg, {row.name: row.offset // 4 for row in self.REGISTERS})
        registers.update(self.value)
        self.value = registers

    def _bind_bank(self) -> None:
        bank = self.shared.bank
        bank.chip = self.soc.chip
        self._c_name = ffi.new("char[]", self.name.encode())  # lives as long as the struct
        bank.name, bank.base = self._c_name, self.base

    def _read_shared(self, offset: int, size: int) -> int | None:
        """What the C part answers to a read."""
        if self.shared is None:
            return None
        bank, value = self.shared.bank, ffi.new("uint32_t *")
        return int(value[0]) if bank.read(ffi.addressof(bank), offset, size, value) else None

    def _write_shared(self, offset: int, size: int, value: int) -> bool:
        """Whether the C part takes a write."""
        if self.shared is None:
            return False
        bank = self.shared.bank
        return bool(bank.write(ffi.addressof(bank), offset, size, value))

    def read(self, offset: int, size: int) -> int:
        """A bus read of `size` bytes."""
        answer = self._read_shared(offset, size)
        if answer is not None:
            return answer
        row = self._readers.get(offset)
        if row is None or size not in self.WIDTHS:
            raise self.unmodelled("read", "?", offset, (1 << (8 * size)) - 1)
        register, reader = row
        return self.value[register.name] if reader is None else reader()

    def write(self, offset: int, size: int, value: int) -> None:
        """A bus write of `size` bytes."""
        if self._write_shared(offset, size, value):
            return
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
