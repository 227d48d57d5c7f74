"""The processor: Unicorn's Cortex-M4, bound to the C part of the chip.

Unicorn executes instructions and calls back on accesses to peripherals. It knows the banked state (PRIMASK,
BASEPRI, IPSR) and says when a handler branches to EXC_RETURN; stacking, unstacking and tail-chaining are done
in run.c as PM0214 2.3.7 describes. Time comes from block_clock.c, which counts instructions block by block.
"""

import ctypes
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import unicorn as unicorn_package
from unicorn import arm_const as arm
from unicorn.unicorn_py3 import unicorn as binding

from hil_sim.board.elf.chip import CData, ffi, lib
from hil_sim.board.elf.errors import CpuFault, RuleViolation
from hil_sim.board.elf.memory import FLASH_BASE, FLASH_SIZE, RAM_BASE, RAM_SIZE, SECTORS, Memory

unicorn: Any = unicorn_package  # its own annotations cover half of it

# Cycles per instruction. Single-cycle arithmetic, two-cycle loads and stores, and the refills of taken
# branches average 1.2 to 1.5 in ART-cached code; 3/2 is the pessimistic end.
CPI = (3, 2)
ENTRY_CYCLES, EXIT_CYCLES = int(lib.ENTRY_CYCLES), int(lib.EXIT_CYCLES)

NO_WATCH = 256
MMIO_MAP = binding.uclib.uc_mmio_map
READ_EXECUTE = unicorn.UC_PROT_READ | unicorn.UC_PROT_EXEC

MmioRead = Callable[[int, int], int]
MmioWrite = Callable[[int, int, int], None]


UNICORN_FUNCTIONS = {
    "emu_start": "int (*)(void *, uint64_t, uint64_t, uint64_t, size_t)",
    "reg_read": "int (*)(void *, int, void *)",
    "reg_write": "int (*)(void *, int, const void *)",
    "reg_read_batch": "int (*)(void *, int *, void **, int)",
    "reg_write_batch": "int (*)(void *, int *, void *const *, int)",
}


def _c_address(name: str) -> ctypes.c_void_p:
    """Of a function of the C part, for ctypes."""
    return ctypes.c_void_p(int(ffi.cast("uintptr_t", ffi.addressof(lib, name))))


class Cpu:
    """Cortex-M4 with its memories; the privileged thread runs on the main stack."""

    def __init__(self, memory: Memory) -> None:
        self._uc = unicorn.Uc(
            unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS, arm.UC_CPU_ARM_CORTEX_M4
        )
        self.memory = memory
        self._error: Exception | None = None
        self._unreadable: set[int] = set()
        self.chip: CData = ffi.gc(ffi.new("chip *"), lib.chip_free)
        self.clock: CData = self.chip.clock
        self._map_memory()
        self._start_clock()
        self._bind()
        self._hook(unicorn.UC_HOOK_BLOCK, "block_clock_hook")
        self._hook(unicorn.UC_HOOK_INTR, "chip_interrupt_hook")
        self._uc.hook_add(unicorn.UC_HOOK_MEM_UNMAPPED, self._on_unmapped)

    def _map_memory(self) -> None:
        """RAM, and a region for each sector: what may be read is decided by sectors.

        The largest first: Unicorn 2.1 places a region behind the smallest that it has, and two that share a
        place share its notes on translated code too: a store to the one drops the code of the other.
        """
        memory = self.memory
        regions = [(RAM_BASE, len(memory.ram), unicorn.UC_PROT_ALL, memory.ram_address)]
        for offset, size in SECTORS:
            regions.append((FLASH_BASE + offset, size, READ_EXECUTE, memory.flash_address + offset))
        for region in sorted(regions, key=lambda region: -region[1]):
            self._uc.mem_map_ptr(*region)

    def _start_clock(self) -> None:
        clock, uclib = self.clock, binding.uclib
        clock.cpi_num, clock.cpi_den = CPI
        clock.watch_priority = NO_WATCH
        clock.code_base, clock.code_size, clock.code = FLASH_BASE, FLASH_SIZE, self.memory.flash_address
        clock.stop = ctypes.cast(uclib.uc_emu_stop, ctypes.c_void_p).value
        clock.reg_read = ctypes.cast(uclib.uc_reg_read, ctypes.c_void_p).value
        clock.reg_primask, clock.reg_basepri = arm.UC_ARM_REG_PRIMASK, arm.UC_ARM_REG_BASEPRI

    def _bind(self) -> None:
        """Tells the C part where Unicorn, its registers and the memories are."""
        chip, uclib = self.chip, binding.uclib
        chip.engine = ffi.cast("void *", self._uc._uch.value)
        for name, kind in UNICORN_FUNCTIONS.items():
            address = ctypes.cast(getattr(uclib, f"uc_{name}"), ctypes.c_void_p).value
            setattr(chip, name, ffi.cast(kind, address))
        chip.id_r = [arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2, arm.UC_ARM_REG_R3]
        for name in (
            "r12",
            "lr",
            "pc",
            "xpsr",
            "sp",
            "control",
            "primask",
            "basepri",
            "faultmask",
            "s0",
            "fpscr",
        ):
            setattr(chip, f"id_{name}", getattr(arm, f"UC_ARM_REG_{name.upper()}"))
        chip.flash = ffi.cast("uint8_t *", self.memory.flash_address)
        chip.ram = ffi.cast("uint8_t *", self.memory.ram_address)
        chip.flash_base, chip.flash_size = FLASH_BASE, FLASH_SIZE
        chip.ram_base, chip.ram_size = RAM_BASE, RAM_SIZE

    def _hook(self, kind: int, function: str) -> None:
        handle = ctypes.c_size_t()
        status = binding.uclib.uc_hook_add(
            self._uc._uch,
            ctypes.byref(handle),
            kind,
            _c_address(function),
            ctypes.c_void_p(int(ffi.cast("uintptr_t", self.chip))),
            ctypes.c_uint64(1),
            ctypes.c_uint64(0),
        )
        if status != unicorn.UC_ERR_OK:
            raise CpuFault(f"Unicorn refused {function} (error {status})")

    def map_bus(self, base: int, size: int) -> None:
        """Sends the accesses to a range to chip_bus_read() and chip_bus_write()."""
        user = ctypes.c_void_p(int(ffi.cast("uintptr_t", self.chip)))
        status = MMIO_MAP(
            self._uc._uch, base, size, _c_address("chip_bus_read"), user, _c_address("chip_bus_write"), user
        )
        if status != unicorn.UC_ERR_OK:
            raise CpuFault(f"Unicorn refused the bus (error {status})")

    def map_peripherals(self, base: int, size: int, read: MmioRead, write: MmioWrite) -> None:
        """Sends the accesses to a range to two functions, which take absolute addresses."""

        def on_read(_uc: object, offset: int, width: int, _user: object) -> int:
            try:
                return read(base + offset, width)
            except Exception as error:
                self._keep(error)
                return 0

        def on_write(_uc: object, offset: int, width: int, value: int, _user: object) -> None:
            try:
                write(base + offset, width, value)
            except Exception as error:
                self._keep(error)

        self._uc.mmio_map(base, size, on_read, None, on_write, None)

    def on_flash_write(self, write: MmioWrite) -> None:
        """Calls a function before the processor writes into the flash; the write then takes place."""

        def on_write(_uc: object, _access: int, address: int, width: int, value: int, _user: object) -> bool:
            try:
                write(address, width, value & ((1 << 8 * width) - 1))
            except Exception as error:
                self._keep(error)
            return True

        self._uc.hook_add(unicorn.UC_HOOK_MEM_WRITE_PROT, on_write)

    def on_unreadable(self, refuse: Callable[[int], None]) -> None:
        """Calls a function when the processor reads where `set_unreadable` forbids it, or may not."""

        def on_read(_uc: object, _access: int, address: int, _size: int, _value: int, _user: object) -> bool:
            try:
                refuse(address)
            except Exception as error:
                self._keep(error)
                return False
            return True

        self._uc.hook_add(unicorn.UC_HOOK_MEM_READ_PROT, on_read)

    def set_unreadable(self, sectors: set[int]) -> None:
        """These sectors of the flash may not be read, the others may. While the processor stands still."""
        for sector in sectors ^ self._unreadable:
            offset, size = SECTORS[sector]
            allowed = unicorn.UC_PROT_EXEC if sector in sectors else READ_EXECUTE
            self._uc.mem_protect(FLASH_BASE + offset, size, allowed)
        self._unreadable = set(sectors)

    def _keep(self, error: Exception) -> None:
        self._error = self._error or error
        self.chip.failed = 1
        self._uc.emu_stop()

    @contextmanager
    def keeping(self) -> Iterator[None]:
        """An error within is kept, and stops the chip: it is raised once the C part has returned."""
        try:
            yield
        except Exception as error:
            self._keep(error)

    def error(self) -> Exception:
        """What stopped the chip; it may run on afterwards."""
        chip, kept = self.chip, self._error
        self._error = None
        chip.failed = 0
        if kept is not None:
            return kept
        if chip.violated:
            chip.violated = 0
            bank, section, rule = (
                ffi.string(text).decode()
                for text in (chip.violation_bank, chip.violation_section, chip.violation_rule)
            )
            if bank == "CPU":
                return CpuFault(f"{rule}, at PC 0x{self.pc:08X}")
            return RuleViolation(bank, rule, section, int(self.clock.block_pc))
        if chip.unicorn_error:
            text = unicorn.UcError(chip.unicorn_error)
            return CpuFault(f"{text} at PC 0x{self.pc:08X}, block 0x{self.clock.block_pc:08X}")
        return CpuFault(f"the processor stopped at PC 0x{self.pc:08X} for no known reason")

    def _on_unmapped(
        self, _uc: object, _access: int, address: int, size: int, _value: int, _user: object
    ) -> bool:
        block = self.clock.block_pc
        self._keep(
            CpuFault(
                f"access of {size} bytes at 0x{address:08X}, where nothing is; block at PC 0x{block:08X}"
            )
        )
        return False

    # --- state --------------------------------------------------------------------------------------

    @property
    def pc(self) -> int:
        """Address of the next instruction, exact while the processor stands still."""
        return int(self._uc.reg_read(arm.UC_ARM_REG_PC))

    def register(self, name: str) -> int:
        """A register by name: "r0", "sp", "xpsr", "primask", ..."""
        return int(self._uc.reg_read(getattr(arm, f"UC_ARM_REG_{name.upper()}")))

    def set_register(self, name: str, value: int) -> None:
        """Sets a register by name."""
        self._uc.reg_write(getattr(arm, f"UC_ARM_REG_{name.upper()}"), value)

    def reset(self, vectors: int) -> None:
        """Stack pointer and program counter from the vector table; thread mode, nothing masked."""
        sp, pc = struct.unpack("<II", self.memory.read_bytes(vectors, 8))
        for name in ("primask", "basepri", "faultmask", "control"):
            self.set_register(name, 0)
        self.set_register("xpsr", 0x0100_0000)
        self.set_register("sp", sp)
        self.set_register("lr", 0xFFFF_FFFF)
        self.set_register("pc", pc)
