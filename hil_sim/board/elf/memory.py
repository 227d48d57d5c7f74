"""Flash and RAM of the chip, in host memory that the processor, the DMA and the tests share."""

import ctypes

from hil_sim.board.elf.errors import EmulatorError

FLASH_BASE = 0x0800_0000
FLASH_SIZE = 512 * 1024
SECTOR_KB = (16, 16, 16, 16, 64, 128, 128, 128)  # RM0390 3.3, table of the flash module organization
SECTORS = [(1024 * sum(SECTOR_KB[:n]), 1024 * size) for n, size in enumerate(SECTOR_KB)]  # offset, bytes
RAM_BASE = 0x2000_0000
RAM_SIZE = 128 * 1024  # SRAM1 and SRAM2 are contiguous (RM0390 2.3.1)
PAGE = 4096


class MemoryRangeError(EmulatorError):
    """An address is in no memory that the chip has."""


def _aligned(size: int) -> tuple[ctypes.Array[ctypes.c_char], int]:
    """A buffer, and the offset of its first page boundary."""
    buffer = ctypes.create_string_buffer(size + PAGE)
    return buffer, -ctypes.addressof(buffer) % PAGE


class Memory:
    """Flash (erased: all ones) and RAM (as chance has it at power-on: here zeros)."""

    def __init__(self) -> None:
        self._flash_buffer, flash_offset = _aligned(FLASH_SIZE)
        self._ram_buffer, ram_offset = _aligned(RAM_SIZE)
        self.flash = memoryview(self._flash_buffer).cast("B")[flash_offset : flash_offset + FLASH_SIZE]
        self.ram = memoryview(self._ram_buffer).cast("B")[ram_offset : ram_offset + RAM_SIZE]
        self.flash_address = ctypes.addressof(self._flash_buffer) + flash_offset
        self.ram_address = ctypes.addressof(self._ram_buffer) + ram_offset
        self.flash[:] = b"\xff" * FLASH_SIZE

    def read_bytes(self, address: int, size: int) -> bytes:
        """Bytes of flash or RAM.

        Raises:
            MemoryRangeError: the range lies in neither.
        """
        for base, view in ((RAM_BASE, self.ram), (FLASH_BASE, self.flash)):
            if base <= address and address + size <= base + len(view):
                return bytes(view[address - base : address - base + size])
        raise MemoryRangeError(f"no memory at 0x{address:08X}")

    def write_ram(self, address: int, data: bytes) -> None:
        """Bytes into RAM.

        Raises:
            MemoryRangeError: the range is not in RAM.
        """
        offset = address - RAM_BASE
        if offset < 0 or offset + len(data) > RAM_SIZE:
            raise MemoryRangeError(f"no RAM at 0x{address:08X}")
        self.ram[offset : offset + len(data)] = data

    def write_flash(self, address: int, data: bytes) -> None:
        """Puts bytes into the flash as a programmer would, without any rule."""
        offset = address - FLASH_BASE
        if offset < 0 or offset + len(data) > FLASH_SIZE:
            raise MemoryRangeError(f"no flash at 0x{address:08X}")
        self.flash[offset : offset + len(data)] = data
