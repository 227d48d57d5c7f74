"""The firmware core in this process, through firmware/boards/native/impid_board.h."""

from dataclasses import dataclass, field
from mmap import mmap

import numpy as np
from numpy.typing import NDArray

from hil_sim._native import ffi, lib
from hil_sim.sensors import adxl355

TICK_US = 1000
TAKE_BYTES = 65536
TAKE_FRAMES = 256
FLASH_BYTES = 4 * 8192  # IMPID_BOARD_FLASH_WORDS
RETAINED_BYTES = 4 * 3  # IMPID_BOARD_RETAINED_WORDS


def new_flash() -> bytearray:
    """The settings' flash as it leaves the factory: all bits 1; 32768 bytes."""
    return bytearray(b"\xff" * FLASH_BYTES)


def unpowered_memory() -> bytearray:
    """Memory that a reset keeps, as a loss of power leaves it."""
    return bytearray(b"\xa5" * RETAINED_BYTES)


@dataclass(frozen=True)
class BoardConfig:
    """What a board brings along at power-on; see impid_board_config.

    Attributes:
        uid: the 96-bit identity of the chip.
        boot_id: different at each boot.
        reset_cause: as in the message set, STATUS_HEALTH.reset_cause.
        first_index: index of the first sample after START.
        start_us: board time of the first tick.
        serial_bytes_per_ms: what the serial line carries; 0: no limit.
        can_frames_per_ms: what the bus carries; 0: no limit.
        part: of the accelerometer; ADXL355 is a sensor of its own, all others are read like the ADXL203.
        flash: FLASH_BYTES keeping the settings; a writable `mmap` keeps them in a file. What `replace`
            makes of this configuration shares it, as boots of one board do.
        retained: RETAINED_BYTES that a reset leaves as they are, and a loss of power does not; shared too.
    """

    uid: tuple[int, int, int] = (0x00320044, 0x31385109, 0x38303634)
    boot_id: int = 1
    reset_cause: int = 1
    first_index: int = 0
    start_us: int = 0
    serial_bytes_per_ms: int = 92
    can_frames_per_ms: int = 0
    part: str = "ADXL203"
    flash: bytearray | mmap = field(default_factory=new_flash, repr=False, compare=False)
    retained: bytearray = field(default_factory=unpowered_memory, repr=False, compare=False)


class NativeBoard:
    """A board in this process; implements `Board`."""

    def __init__(self, config: BoardConfig) -> None:
        if len(config.flash) != FLASH_BYTES:
            raise ValueError(f"a flash of {len(config.flash)} bytes; the board's has {FLASH_BYTES}")
        self._next_tick_us = config.start_us
        self._digital = config.part == adxl355.PART
        self._flash = ffi.from_buffer("uint32_t[]", config.flash, require_writable=True)
        self._retained = ffi.from_buffer("uint32_t[]", config.retained, require_writable=True)
        board = lib.impid_board_new(
            ffi.new(
                "impid_board_config *",
                {
                    "uid": list(config.uid),
                    "boot_id": config.boot_id,
                    "reset_cause": config.reset_cause,
                    "first_index": config.first_index,
                    "start_us": config.start_us,
                    "serial_bytes_per_ms": config.serial_bytes_per_ms,
                    "can_frames_per_ms": config.can_frames_per_ms,
                    "digital": config.part == adxl355.PART,
                    "flash": self._flash,
                    "retained": self._retained,
                },
            )
        )
        if board == ffi.NULL:
            raise MemoryError("no memory for a board")
        self._board = ffi.gc(board, lib.impid_board_free)
        self._buffer = ffi.new("uint8_t[]", TAKE_BYTES)
        self._frames = ffi.new("impid_board_can_frame[]", TAKE_FRAMES)

    @property
    def now_us(self) -> int:
        """The board's clock, microseconds since its boot."""
        return int(lib.impid_board_now_us(self._board))

    @property
    def next_tick_us(self) -> int:
        """Board time of the next tick that `run` will run."""
        return self._next_tick_us

    @property
    def lines_idle_us(self) -> int:
        """Board time at which all that now waits will have left the board."""
        return int(lib.impid_board_lines_idle_us(self._board))

    @property
    def streaming(self) -> bool:
        """Samples leave on some carrier."""
        return bool(lib.impid_board_streaming(self._board))

    @property
    def self_test_pin(self) -> bool:
        """The accelerometer's self-test input is driven."""
        return bool(lib.impid_board_self_test_pin(self._board))

    @property
    def reset_requested(self) -> bool:
        """True once after a RESET command."""
        return bool(lib.impid_board_reset_requested(self._board))

    def run(
        self,
        adc: NDArray[np.uint16] | NDArray[np.uint32],
        encoder: NDArray[np.int32],
        faults: NDArray[np.uint8] | None = None,
    ) -> None:
        """Runs one tick per row.

        Args:
            adc: codes, shape (n, 8, 2) of 16 bits; of the digital sensor shape (n, 1, 3) of 32 bits.
            encoder: counts, shape (n, 2).
            faults: bits, shape (n,).
        """
        pointer = ffi.from_buffer
        ticks = encoder.shape[0]
        run, words = (lib.impid_board_run_wide, 3) if self._digital else (lib.impid_board_run, 16)
        if adc.dtype != (np.uint32 if self._digital else np.uint16) or adc.size != ticks * words:
            raise ValueError(f"{adc.shape} readings of {adc.dtype} are not {ticks} ticks of this sensor")
        run(
            self._board,
            ticks,
            pointer("uint32_t[]" if self._digital else "uint16_t[]", np.ascontiguousarray(adc)),
            pointer("int32_t[]", np.ascontiguousarray(encoder)),
            ffi.NULL if faults is None else pointer("uint8_t[]", np.ascontiguousarray(faults)),
        )
        self._next_tick_us += TICK_US * ticks

    def advance(self, t_us: int) -> None:
        """Lets the lines carry on until board time t_us, between ticks."""
        lib.impid_board_advance(self._board, t_us)

    def can_bus_off(self) -> None:
        """The CAN controller has seen too many errors and left the bus; what waited for it is lost."""
        lib.impid_board_can_bus_off(self._board)

    def serial_receive(self, data: bytes, t_us: int) -> None:
        """Bytes that arrived at board time t_us."""
        lib.impid_board_serial_receive(self._board, data, len(data), t_us)

    def serial_take(self) -> bytes:
        """Bytes that the board has sent since the last call."""
        taken = []
        while count := lib.impid_board_serial_take(self._board, self._buffer, TAKE_BYTES):
            taken.append(bytes(ffi.buffer(self._buffer, count)))
        return b"".join(taken)

    def can_receive(self, identifier: int, data: bytes, t_us: int) -> None:
        """A classic frame that arrived at board time t_us."""
        frame = ffi.new("impid_board_can_frame *", {"id": identifier, "dlc": len(data), "data": data})
        lib.impid_board_can_receive(self._board, frame, t_us)

    def can_take(self) -> list[tuple[int, bytes]]:
        """Identifier and data of the frames that the board has sent since the last call."""
        taken = []
        while count := lib.impid_board_can_take(self._board, self._frames, TAKE_FRAMES):
            taken += [(int(f.id), bytes(f.data[0 : f.dlc])) for f in self._frames[0:count]]
        return taken

    def close(self) -> None:
        """Gives back the board's memory at once."""
        ffi.release(self._board)
