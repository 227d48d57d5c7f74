"""Device electronic signature (RM0390 chapter 34) and the factory calibration in the system memory."""

from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.registers import Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

VREFINT_CAL = 1502  # 1.21 V at VDDA = 3.3 V: 1.21 / 3.3 * 4095 (data sheet, embedded reference voltage)


class Signature(Peripheral):
    """Unique identity, flash size, calibration of the internal reference; read-only."""

    WIDTHS = (2, 4)
    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("UID0", 0xA10, "34.1"),
        Register("UID1", 0xA14, "34.1"),
        Register("UID2", 0xA18, "34.1"),
        Register("FLASH_SIZE", 0xA22, "34.2", reset=512),
        Register("VREFINT_CAL", 0xA2A, "data sheet", reset=VREFINT_CAL),
    )

    def __init__(self, base: int, soc: "Soc", uid: tuple[int, int, int]) -> None:
        super().__init__("SYSTEM_MEMORY", base, soc)
        for index, word in enumerate(uid):
            self.value[f"UID{index}"] = word

    def write(self, offset: int, size: int, value: int) -> None:
        """There is nothing to write."""
        del size
        raise self.unmodelled("write", "?", offset, value)
