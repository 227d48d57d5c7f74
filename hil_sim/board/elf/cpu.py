"""The processor: Unicorn's Cortex-M4, plus the exception entry and return that Unicorn leaves to its user.

Unicorn executes instructions and calls back on accesses to peripherals. It knows the banked state (PRIMASK,
BASEPRI, IPSR) and says when a handler branches to EXC_RETURN; stacking, unstacking and tail-chaining are done
here as PM0214 2.3.7 describes. Time comes from `block_clock.c`, which counts instructions before each block.
"""

import ctypes
import struct
from collections.abc import Callable
from enum import Enum, auto
from typing import Any

import unicorn as unicorn_package
from unicorn import arm_const as arm
from unicorn.unicorn_py3 import unicorn as binding

from hil_sim._block_clock import ffi, lib
from hil_sim.board.elf.errors import CpuFault, EmulatorError
from hil_sim.board.elf.memory import FLASH_BASE, FLASH_SIZE, RAM_BASE, SECTORS, Memory

unicorn: Any = unicorn_package  # its own annotations cover half of it

# Cycles per instruction. Single-cycle arithmetic, two-cycle loads and stores, and the refills of taken
# branches average 1.2 to 1.5 in ART-cached code; 3/2 is the pessimistic end.
CPI = (3, 2)
ENTRY_CYCLES = 12  # Cortex-M4 TRM 3.9.1, without wait states
EXIT_CYCLES = 10
TAIL_CYCLES = 6

EXCEPTION_EXIT = 8  # Unicorn's number for a branch to EXC_RETURN
RETURN_HANDLER = 0xFFFF_FFF1  # PM0214 2.3.7, table of EXC_RETURN
RETURN_THREAD = 0xFFFF_FFF9
NO_FP_FRAME = 1 << 4
CONTROL_FPCA = 1 << 2
CONTROL_SPSEL = 1 << 1
XPSR_ALIGNED = 1 << 9
WFI = b"\x30\xbf"
NO_WATCH = 256
READ_EXECUTE = unicorn.UC_PROT_READ | unicorn.UC_PROT_EXEC

MmioRead = Callable[[int, int], int]
MmioWrite = Callable[[int, int, int], None]


class Stop(Enum):
    """Why the processor stopped executing."""

    DEADLINE = auto()
    SLEEP = auto()
    EXCEPTION_RETURN = auto()


class Cpu:
    """Cortex-M4 with its memories; the privileged thread runs on the main stack."""

    def __init__(self, memory: Memory) -> None:
        self._uc = unicorn.Uc(
            unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS, arm.UC_CPU_ARM_CORTEX_M4
        )
        self.memory = memory
        self._error: Exception | None = None
        self._exit: int | None = None
        self._unreadable: set[int] = set()
        self.clock = ffi.new("block_clock *")
        self._map_memory()
        self._start_clock()
        self._uc.hook_add(unicorn.UC_HOOK_INTR, self._on_interrupt)
        self._uc.hook_add(unicorn.UC_HOOK_MEM_UNMAPPED, self._on_unmapped)

    def _map_memory(self) -> None:
        memory, uc = self.memory, self._uc
        for offset, size in SECTORS:  # a region each: what may be read is decided by sectors
            uc.mem_map_ptr(FLASH_BASE + offset, size, READ_EXECUTE, memory.flash_address + offset)
        uc.mem_map_ptr(RAM_BASE, len(memory.ram), unicorn.UC_PROT_ALL, memory.ram_address)

    def _start_clock(self) -> None:
        clock, uclib = self.clock, binding.uclib
        clock.cpi_num, clock.cpi_den = CPI
        clock.watch_priority = NO_WATCH
        clock.code_base, clock.code_size, clock.code = FLASH_BASE, FLASH_SIZE, self.memory.flash_address
        clock.stop = ctypes.cast(uclib.uc_emu_stop, ctypes.c_void_p).value
        clock.reg_read = ctypes.cast(uclib.uc_reg_read, ctypes.c_void_p).value
        clock.reg_primask, clock.reg_basepri = arm.UC_ARM_REG_PRIMASK, arm.UC_ARM_REG_BASEPRI
        handle = ctypes.c_size_t()
        hook = int(ffi.cast("uintptr_t", ffi.addressof(lib, "block_clock_hook")))
        user = int(ffi.cast("uintptr_t", clock))
        status = uclib.uc_hook_add(
            self._uc._uch,
            ctypes.byref(handle),
            unicorn.UC_HOOK_BLOCK,
            ctypes.c_void_p(hook),
            ctypes.c_void_p(user),
            ctypes.c_uint64(1),
            ctypes.c_uint64(0),
        )
        if status != unicorn.UC_ERR_OK:
            raise CpuFault(f"Unicorn refused the block hook (error {status})")

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
        self._uc.emu_stop()

    def _on_interrupt(self, _uc: object, number: int, _user: object) -> None:
        if number == EXCEPTION_EXIT:
            self._exit = self.pc | 1
            self._uc.emu_stop()
        else:
            self._keep(CpuFault(f"processor exception {number} at PC 0x{self.pc:08X}"))

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

    # --- running ------------------------------------------------------------------------------------

    def run(self, deadline: int) -> Stop:
        """Executes until a cycle, a WFI, or the end of a handler."""
        clock = self.clock
        clock.deadline = deadline
        clock.stopped = 0
        self._exit = None
        try:
            self._uc.emu_start(self.pc | 1, 0)
        except unicorn.UcError as error:
            if self._error is None:
                self._error = CpuFault(f"{error} at PC 0x{self.pc:08X}, block 0x{clock.block_pc:08X}")
        if self._error is not None:
            error_seen, self._error = self._error, None
            raise error_seen
        if self._exit is not None:
            return Stop.EXCEPTION_RETURN
        if clock.stopped:
            return Stop.DEADLINE
        if self.memory.read_bytes(self.pc - 2, 2) == WFI:
            return Stop.SLEEP
        raise CpuFault(f"the processor stopped at PC 0x{self.pc:08X} for no known reason")

    def take_exit(self) -> int:
        """The EXC_RETURN value that ended the last run."""
        if self._exit is None:
            raise CpuFault("no handler has returned")
        return self._exit

    def masks(self) -> tuple[bool, int]:
        """PRIMASK, and BASEPRI (0: masks nothing)."""
        primask, basepri, faultmask = self._uc.reg_read_batch(MASK_IDS)
        if faultmask & 1:
            raise CpuFault(f"FAULTMASK is set at PC 0x{self.pc:08X}; the emulator does not model it")
        return bool(primask & 1), int(basepri)

    # --- exceptions (PM0214 2.3.7) ------------------------------------------------------------------

    def enter(self, exception: int, handler: int, nested: bool) -> None:
        """Pushes the frame and goes to the handler."""
        values = self._uc.reg_read_batch(FRAME_IDS)
        *frame, xpsr, sp, control = (int(value) for value in values)
        if control & CONTROL_SPSEL:
            raise CpuFault("the thread uses the process stack; the emulator does not model it")
        extended = bool(control & CONTROL_FPCA)
        size = 0x68 if extended else 0x20
        aligned = (sp - size) & ~4  # CCR.STKALIGN: eight-byte alignment, remembered in xPSR bit 9
        xpsr = (xpsr & ~XPSR_ALIGNED) | (XPSR_ALIGNED if sp & 4 else 0)
        self._push(aligned, struct.pack("<8I", *frame, xpsr))
        if extended:
            self._push(aligned + 0x20, self._floating_point_frame())
            self.set_register("control", control & ~CONTROL_FPCA)
        lr = (RETURN_HANDLER if nested else RETURN_THREAD) & ~(NO_FP_FRAME if extended else 0)
        self._go(exception, handler, aligned, lr)
        self.clock.cycles += ENTRY_CYCLES

    def tail_chain(self, exception: int, handler: int) -> None:
        """Goes from one handler to the next without touching the frame."""
        self._go(exception, handler, self.register("sp"), self.take_exit())
        self.clock.cycles += TAIL_CYCLES

    def leave(self) -> None:
        """Pops the frame that EXC_RETURN names."""
        exc_return, sp = self.take_exit(), self.register("sp")
        if exc_return | NO_FP_FRAME not in (RETURN_HANDLER, RETURN_THREAD):
            raise CpuFault(f"EXC_RETURN 0x{exc_return:08X} names a stack that the emulator does not model")
        frame = struct.unpack("<8I", self.memory.read_bytes(sp, 32))
        extended = not exc_return & NO_FP_FRAME
        size = 0x68 if extended else 0x20
        if extended:
            self._restore_floating_point(self.memory.read_bytes(sp + 0x20, 0x44))
        xpsr = frame[7]
        if (xpsr & 0x1FF == 0) != (exc_return | NO_FP_FRAME == RETURN_THREAD):
            raise CpuFault(f"EXC_RETURN 0x{exc_return:08X} does not fit the stacked xPSR 0x{xpsr:08X}")
        sp = (sp + size) | (4 if xpsr & XPSR_ALIGNED else 0)
        self._uc.reg_write_batch(
            list(zip(RESTORE_IDS, (*frame[:6], sp, xpsr & ~XPSR_ALIGNED, frame[6] & ~1), strict=True))
        )
        control = self.register("control") & ~CONTROL_FPCA
        self.set_register("control", control | (CONTROL_FPCA if extended else 0))
        self.clock.cycles += EXIT_CYCLES

    def _go(self, exception: int, handler: int, sp: int, lr: int) -> None:
        flags = self.register("xpsr") & 0xF80F_0000  # the handler starts outside any IT block
        self._uc.reg_write_batch(
            [
                (arm.UC_ARM_REG_XPSR, flags | 0x0100_0000 | exception),
                (arm.UC_ARM_REG_SP, sp),
                (arm.UC_ARM_REG_LR, lr),
                (arm.UC_ARM_REG_PC, handler & ~1),
            ]
        )

    def _push(self, address: int, data: bytes) -> None:
        try:
            self.memory.write_ram(address, data)
        except EmulatorError as error:
            raise CpuFault(f"stacking failed at PC 0x{self.pc:08X}: {error}") from error

    def _floating_point_frame(self) -> bytes:
        singles = [self.register(f"s{index}") for index in range(16)]
        return struct.pack("<18I", *singles, self.register("fpscr"), 0)

    def _restore_floating_point(self, data: bytes) -> None:
        *singles, fpscr = struct.unpack("<17I", data)
        for index, value in enumerate(singles):
            self.set_register(f"s{index}", value)
        self.set_register("fpscr", fpscr)


MASK_IDS = [arm.UC_ARM_REG_PRIMASK, arm.UC_ARM_REG_BASEPRI, arm.UC_ARM_REG_FAULTMASK]
FRAME_IDS = [
    arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2, arm.UC_ARM_REG_R3, arm.UC_ARM_REG_R12,
    arm.UC_ARM_REG_LR, arm.UC_ARM_REG_PC, arm.UC_ARM_REG_XPSR, arm.UC_ARM_REG_SP, arm.UC_ARM_REG_CONTROL,
]  # fmt: skip
RESTORE_IDS = [
    arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2, arm.UC_ARM_REG_R3, arm.UC_ARM_REG_R12,
    arm.UC_ARM_REG_LR, arm.UC_ARM_REG_SP, arm.UC_ARM_REG_XPSR, arm.UC_ARM_REG_PC,
]  # fmt: skip
