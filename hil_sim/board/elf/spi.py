"""Serial peripheral interface (RM0390 chapter 26): master, full duplex, bytes, polled, select by software."""

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.registers import ALL, Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

CPHA_CPOL, MSTR, BR, SPE, SSI, SSM = 3, 1 << 2, 7 << 3, 1 << 6, 1 << 8, 1 << 9
RXNE, TXE, OVR, BSY = 1 << 0, 1 << 1, 1 << 6, 1 << 7
BITS = 8


class Spi(Peripheral):
    """A master; `exchange` is what the world answers to a byte, clocked in a mode (0 to 3)."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("CR1", 0x00, "26.7.1", modelled=CPHA_CPOL | MSTR | BR | SPE | SSI | SSM),
        Register("CR2", 0x04, "26.7.2"),
        Register("SR", 0x08, "26.7.3", reset=TXE),
        Register("DR", 0x0C, "26.7.4", modelled=0xFF),
    )
    WIDTHS = (1, 2, 4)

    def __init__(self, name: str, base: int, soc: "Soc") -> None:
        super().__init__(name, base, soc)
        self.exchange: Callable[[int, int], int] = lambda _byte, _mode: 0  # nobody is there
        self._done = 0  # the cycle at which the byte under way is complete
        self._under_way: int | None = None

    @property
    def bit_cycles(self) -> int:
        """A bit in cycles of the processor's clock: the bus clock over 2 to 256 (26.7.1, BR)."""
        return self.soc.rcc.bus_divider(1) * (2 << (self.value["CR1"] >> 3 & 7))

    def _settle(self) -> None:
        """What has passed by now."""
        if self._under_way is not None and self.soc.clock.cycles >= self._done:
            if self.value["SR"] & RXNE:
                self.value["SR"] |= OVR
            else:
                self.value["DR"] = self._under_way
            self.value["SR"] = self.value["SR"] & ~BSY | RXNE | TXE
            self._under_way = None

    def read_sr(self) -> int:
        """Flags."""
        self._settle()
        return self.value["SR"]

    def read_dr(self) -> int:
        """The byte received; clears RXNE (26.3.9)."""
        self._settle()
        self.value["SR"] &= ~RXNE
        return self.value["DR"]

    def write_cr1(self, value: int) -> None:
        """A slave, or a select by hardware, has no model; the mode may not change while enabled (26.3.8)."""
        if value & SPE and not (value & MSTR and value & SSM and value & SSI):
            raise self.unmodelled("write", "CR1", 0x00, value)
        if self.value["CR1"] & value & SPE and (self.value["CR1"] ^ value) & (CPHA_CPOL | BR):
            raise self.violation("clock changed while SPE is set", "26.3.8")
        self.value["CR1"] = value

    def write_dr(self, value: int) -> None:
        """Begins a byte; a second one meanwhile would wait in the buffer, which has no model."""
        if not self.value["CR1"] & SPE:
            raise self.violation("DR written while SPE is clear", "26.3.5")
        for signal in ("SCK", "MISO", "MOSI"):
            if not self.soc.routed(f"{self.name}_{signal}"):
                raise self.violation(f"transfer while no pin is switched to {signal}", "7.3.2")
        self._settle()
        if self._under_way is not None:
            raise self.unmodelled("write", "DR", 0x0C, value)
        self._under_way = self.exchange(value & 0xFF, self.value["CR1"] & CPHA_CPOL) & 0xFF
        self._done = self.soc.clock.cycles + BITS * self.bit_cycles
        self.value["SR"] = self.value["SR"] & ~TXE & ALL | BSY
