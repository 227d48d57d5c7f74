"""Power controller (RM0390 chapter 5): the regulator's voltage scale."""

from typing import ClassVar

from hil_sim.board.elf.registers import Peripheral, Register

VOS = 3 << 14
VOSRDY = 1 << 14
# Maximum HCLK without over-drive by voltage scale (RM0390 5.1.3).
LIMIT_HZ = {1: 120e6, 2: 144e6, 3: 168e6}


class Pwr(Peripheral):
    """Regulator scale; over-drive, the voltage detector and the low-power modes are not modelled."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("CR", 0x00, "5.4.1", reset=0xC000, modelled=VOS),
        Register("CSR", 0x04, "5.4.2"),
    )

    @property
    def limit_hz(self) -> float:
        """Fastest HCLK that the scale allows."""
        return LIMIT_HZ[self.value["CR"] >> 14 & 3]

    def write_cr(self, value: int) -> None:
        """VOS may change only while the PLL is off; 00 is reserved (5.4.1)."""
        if self.soc.rcc.value["CR"] >> 24 & 1:
            raise self.violation("VOS written while the PLL is on", "5.4.1")
        if not value & VOS:
            raise self.violation("VOS 00 is reserved", "5.4.1")
        self.value["CR"] = value

    def read_csr(self) -> int:
        """VOSRDY."""
        return VOSRDY
