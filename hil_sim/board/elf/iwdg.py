"""Independent watchdog (RM0390 chapter 20)."""

from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.chip import CData, ffi, lib
from hil_sim.board.elf.registers import Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

LSI_HZ = 32_000.0  # nominal; 17 to 47 kHz by the data sheet
UPDATE_LSI_CYCLES = 5  # "up to five RC 40 kHz cycles" (20.4.4)
REFRESH, ACCESS, START = 0xAAAA, 0x5555, 0xCCCC


class Iwdg(Peripheral):
    """Counts down with the low-speed oscillator and resets the chip at zero."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("KR", 0x00, "20.4.1", modelled=0xFFFF),
        Register("PR", 0x04, "20.4.2", modelled=7),
        Register("RLR", 0x08, "20.4.3", reset=0xFFF, modelled=0xFFF),
        Register("SR", 0x0C, "20.4.4"),
    )

    def __init__(self, base: int, soc: "Soc") -> None:
        super().__init__("IWDG", base, soc)
        self._busy = {"PR": -1.0, "RLR": -1.0}

    @property
    def timeout_s(self) -> float:
        """(RLR + 1) counts of LSI over 4 * 2^PR: 512 ms for /4 and 0xFFF at 32 kHz (table of 20.3)."""
        divider = 4 << min(self.value["PR"], 6)
        return (self.value["RLR"] + 1) * divider / LSI_HZ

    def read_kr(self) -> int:
        """Write-only: reads as 0."""
        return 0

    def _shared(self) -> CData:
        watchdog = ffi.new("iwdg *")
        lib.iwdg_bind(watchdog)
        return watchdog

    def write_kr(self, value: int) -> None:
        """The three keys; any other value locks PR and RLR again."""
        shared = self.shared
        shared.unlocked = value == ACCESS
        shared.timeout_s = self.timeout_s
        started = bool(shared.running)
        if value == START:
            shared.running = 1
        if value == REFRESH or (value == START and not started):
            lib.iwdg_reload(shared)
        elif value not in (ACCESS, START):
            raise self.unmodelled("write", "KR", 0, value)

    def _write_protected(self, register: str, value: int) -> None:
        if not self.shared.unlocked:
            raise self.violation(f"{register} written without the key 0x5555", "20.3.2")
        if self.soc.schedule.seconds() < self._busy[register]:
            raise self.violation(f"{register} written while its last update is under way", "20.4.4")
        self.value[register] = value
        self.shared.timeout_s = self.timeout_s
        self._busy[register] = self.soc.schedule.seconds() + UPDATE_LSI_CYCLES / LSI_HZ

    def write_pr(self, value: int) -> None:
        """Prescaler, behind the key."""
        self._write_protected("PR", value)

    def write_rlr(self, value: int) -> None:
        """Reload value, behind the key; it counts from the next reload on."""
        self._write_protected("RLR", value)

    def read_sr(self) -> int:
        """PVU and RVU: an update of PR or RLR is under way."""
        now = self.soc.schedule.seconds()
        return (now < self._busy["PR"]) | (now < self._busy["RLR"]) << 1
