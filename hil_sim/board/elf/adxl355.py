"""The ADXL355 at the chip's pins: its registers over SPI, and readings taken where SYNC rises.

Source: Analog Devices, ADXL354/ADXL355 data sheet, register map and serial communications. What it measures
is the caller's; how it filters is in sensors/adxl355.py. Refused are settings that have no model there.
"""

from collections.abc import Callable

from hil_sim.board.elf.errors import EmulatorError

AXES = 3
PARTID, STATUS, XDATA3, ZDATA1 = 0x02, 0x04, 0x08, 0x10
FILTER, SYNC, RANGE, POWER_CTL, SELF_TEST, RESET = 0x28, 0x2B, 0x2C, 0x2D, 0x2E, 0x2F
DATA_RDY, STANDBY = 0x01, 0x01
IDENTITY = {0x00: 0xAD, 0x01: 0x1D, PARTID: 0xED, 0x03: 0x01}
DEFAULTS = {FILTER: 0x00, SYNC: 0x00, RANGE: 0x81, POWER_CTL: STANDBY, SELF_TEST: 0x00}
# 1000 Hz; synchronised from outside, interpolated; 2 g.
MODELLED = {FILTER: 0x02, SYNC: 0x02, RANGE: 0x81}
SPI_MODE = 0


class Adxl355:
    """A sensor that the chip talks to.

    Args:
        latest: how often SYNC has risen by now, and the readings then: offset binary, 20 bits, three axes.
    """

    def __init__(self, latest: Callable[[], tuple[int, tuple[int, int, int]]]) -> None:
        self._latest = latest
        self.present = True
        self._value = dict(DEFAULTS)
        self._selected = False
        self._address: int | None = None  # of the next byte; None: the command is to come
        self._writes = False
        self._latched: tuple[int, int, int] = (0, 0, 0)
        self._read = 0  # rises whose reading was fetched

    @property
    def self_test(self) -> bool:
        """Mode and force are on."""
        return self._value[SELF_TEST] == 3

    def select(self, selected: bool) -> None:
        """Chip select; its edges frame a transfer."""
        if selected != self._selected:
            self._selected, self._address = selected, None

    def exchange(self, byte: int, mode: int) -> int:
        """A byte in, and the one that comes out meanwhile."""
        if not self._selected or not self.present:
            return 0
        if mode != SPI_MODE:
            raise EmulatorError(f"the ADXL355 is clocked in SPI mode {mode}; it knows mode {SPI_MODE}")
        if self._address is None:
            self._address, self._writes = byte >> 1, not byte & 1
            return 0
        address, self._address = self._address, self._address + 1
        if self._writes:
            self._write(address, byte)
            return 0
        return self._register(address)

    def _measures(self) -> bool:
        if self._value[POWER_CTL] & STANDBY:
            return False
        for address, value in MODELLED.items():
            if self._value[address] != value:
                raise EmulatorError(
                    f"the ADXL355 measures with register 0x{address:02X} = 0x{self._value[address]:02X}, "
                    f"which has no model; 0x{value:02X} has"
                )
        return True

    def _write(self, address: int, byte: int) -> None:
        if address not in DEFAULTS:
            raise EmulatorError(f"register 0x{address:02X} of the ADXL355 has no model")
        standby = self._value[POWER_CTL] & STANDBY
        if not standby and address not in (POWER_CTL, SELF_TEST):
            raise EmulatorError(f"register 0x{address:02X} of the ADXL355 written outside standby")
        self._value[address] = byte
        if address == POWER_CTL and standby and self._measures():
            self._read = self._latest()[0]

    def _register(self, address: int) -> int:
        if address in IDENTITY:
            return IDENTITY[address]
        if address == STATUS:
            return DATA_RDY if self._measures() and self._latest()[0] != self._read else 0
        if XDATA3 <= address <= ZDATA1:
            if address == XDATA3:
                self._read, self._latched = self._latest() if self._measures() else (self._read, (0, 0, 0))
            axis, byte = divmod(address - XDATA3, AXES)
            return (self._latched[axis] ^ 0x80000) << 4 >> 8 * (2 - byte) & 0xFF
        return self._value.get(address, 0)  # FIFO_ENTRIES, TEMP: the program does not use them
