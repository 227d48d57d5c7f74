"""Embedded flash memory interface (RM0390 chapter 3): wait states, unlocking, programming, sector erase.

The processor runs from the same single bank, so it stalls while an operation is under way (3.5.1): the
operation's time is added to its clock at once, and BSY is never seen set by code in flash.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.errors import PowerCut
from hil_sim.board.elf.memory import FLASH_BASE, SECTORS
from hil_sim.board.elf.registers import ALL, Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

KEY1, KEY2 = 0x4567_0123, 0xCDEF_89AB  # 3.5.2
PG, SER, STRT, LOCK = 1 << 0, 1 << 1, 1 << 16, 1 << 31
EOP, PGPERR, PGSERR = 1 << 0, 1 << 6, 1 << 7
ERRORS = 0x1F2
PRFTEN, ICEN, DCEN, ICRST, DCRST = 1 << 8, 1 << 9, 1 << 10, 1 << 11, 1 << 12
# Data sheet, flash memory programming: typical times. Erase by sector size and parallelism.
PROGRAM_S = 16e-6
ERASE_S = {16: (0.4, 0.3, 0.25), 64: (1.2, 0.7, 0.55), 128: (2.0, 1.3, 1.0)}


@dataclass
class Cut:
    """A planned failure of the supply.

    Attributes:
        operations: programming or erase operations that still succeed.
        bytes_kept: of the word being programmed (or, for an erase, of the sector) when the supply fails:
            those bytes have changed, the others have not.
    """

    operations: int
    bytes_kept: int = 0


def sector_range(sector: int) -> tuple[int, int]:
    """First offset in the flash, and size, both in bytes."""
    return SECTORS[sector]


class Flash(Peripheral):
    """FLASH_ACR to FLASH_CR; `program` is what the processor's writes into the memory lead to."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("ACR", 0x00, "3.8.1", modelled=0x0F | PRFTEN | ICEN | DCEN | ICRST | DCRST),
        Register("KEYR", 0x04, "3.8.2", modelled=ALL),
        Register("SR", 0x0C, "3.8.4", modelled=ERRORS | EOP | 1 << 16),
        Register("CR", 0x10, "3.8.5", reset=LOCK, modelled=PG | SER | 0x78 | 0x300 | STRT | LOCK),
    )

    def __init__(self, base: int, soc: "Soc") -> None:
        super().__init__("FLASH", base, soc)
        self._key_step = 0
        self._key_failed = False
        self._undo: list[tuple[int, bytes]] = []
        self.stale: set[int] = set()  # sectors erased while the data cache may hold what was in them
        self.operations = 0
        self.cut: Cut | None = None

    @property
    def latency(self) -> int:
        """Wait states."""
        return self.value["ACR"] & 0xF

    def write_acr(self, value: int) -> None:
        """Caches may be reset only while they are off (3.8.1)."""
        if (value & ICRST and self.value["ACR"] & value & ICEN) or (
            value & DCRST and self.value["ACR"] & value & DCEN
        ):
            raise self.violation("a cache was reset while it is enabled", "3.8.1")
        if value & DCRST:
            self.stale.clear()
            self.soc.flash_touched()
        self.value["ACR"] = value

    def read_keyr(self) -> int:
        """Write-only: reads as 0."""
        return 0

    def write_keyr(self, value: int) -> None:
        """KEY1 then KEY2 unlock CR; anything else locks it until the next reset (3.5.2)."""
        expected = (KEY1, KEY2)[self._key_step]
        if self._key_failed or value != expected or not self.value["CR"] & LOCK:
            self._key_failed = True
            raise self.violation("a wrong unlock sequence raises a bus error", "3.5.2")
        self._key_step = 1 - self._key_step
        if self._key_step == 0:
            self.value["CR"] &= ~LOCK

    def write_sr(self, value: int) -> None:
        """Flags are cleared by writing ones; BSY is read-only."""
        self.value["SR"] &= ~(value & (ERRORS | EOP))

    def write_cr(self, value: int) -> None:
        """Not writable while locked; STRT with SER erases a sector."""
        if self.value["CR"] & LOCK:
            if value != self.value["CR"]:
                raise self.violation("CR written while it is locked", "3.8.5")
            return
        self.value["CR"] = value & ~STRT
        if value & STRT:
            if not value & SER or value & PG:
                raise self.violation("STRT without SER alone", "3.5.3")
            self._erase(value >> 3 & 0xF, value >> 8 & 3)

    def _erase(self, sector: int, parallelism: int) -> None:
        if sector >= len(SECTORS):
            raise self.violation(f"there is no sector {sector}", "3.3")
        if self.value["SR"] & ERRORS:
            raise self.violation("erase started with error flags set", "3.5.3")
        start, size = sector_range(sector)
        kept = self._spend(size)
        self.soc.memory.flash[start : start + kept] = b"\xff" * kept
        self._finish(kept < size)
        if self.value["ACR"] & DCEN:
            self.stale.add(sector)
            self.soc.flash_touched()
        self.soc.stall(ERASE_S[size // 1024][min(parallelism, 2)])

    def _spend(self, size: int) -> int:
        """Counts an operation. Returns how many of its bytes change before the supply fails."""
        self.operations += 1
        if self.cut is None:
            return size
        self.cut.operations -= 1
        return size if self.cut.operations >= 0 else min(size, self.cut.bytes_kept)

    def _finish(self, cut: bool) -> None:
        if cut or (self.cut is not None and self.cut.operations < 0):
            raise PowerCut("the supply was cut during a flash operation")

    def program(self, address: int, size: int, value: int) -> None:
        """The processor writes `size` bytes into the flash (3.5.4).

        Called before the bytes change. Bits go from 1 to 0 only; a write that the rules refuse sets its error
        flag and leaves the memory as it is: `settle` puts back what the bus wrote meanwhile.
        """
        offset = address - FLASH_BASE
        old = bytes(self.soc.memory.flash[offset : offset + size])
        error = self._refusal(size)
        self.value["SR"] |= error
        wanted = value.to_bytes(size, "little")
        if error:
            wanted = old
        else:
            kept = self._spend(size)
            merged = bytes(a & b for a, b in zip(old, wanted, strict=True))
            wanted = merged[:kept] + old[kept:]
            if self.cut is not None and self.cut.operations < 0:
                self.soc.memory.flash[offset : offset + size] = wanted
                self._undo.append((offset, wanted))
                self._finish(True)
            self.soc.stall(PROGRAM_S)
        self._undo.append((offset, wanted))
        self.soc.interrupts_changed()

    def _refusal(self, size: int) -> int:
        cr = self.value["CR"]
        if cr & LOCK or not cr & PG or self.value["SR"] & ERRORS:
            return PGSERR  # the sequence was wrong (3.8.4)
        return 0 if size == 1 << (cr >> 8 & 3) else PGPERR  # width and PSIZE differ

    def settle(self) -> None:
        """Gives the bytes written since the last call the value that the rules allow."""
        for offset, data in self._undo:
            self.soc.memory.flash[offset : offset + len(data)] = data
        self._undo.clear()

    def refuse_stale_read(self, address: int) -> None:
        """Of an erased sector the data cache may still hold what was in it (3.5.3)."""
        if all(not 0 <= address - FLASH_BASE - SECTORS[n][0] < SECTORS[n][1] for n in self.stale):
            return  # flushed just now
        raise self.violation(
            f"0x{address:08X} read after an erase without a flush of the data cache", "3.5.3"
        )
