"""Which board a simulation runs on: the native core, or the shipping binary."""

from collections.abc import Callable
from pathlib import Path

from hil_sim.board.native import BoardConfig, NativeBoard
from hil_sim.board.protocol import Board
from hil_sim.sensors import adxl355

BoardMaker = Callable[[BoardConfig], Board]


def maker(binary: Path | None) -> BoardMaker:
    """What makes the boards of a simulation.

    Args:
        binary: the ELF file to run in the emulator, or None for the native core. The binary decides its own
            boot identity and begins its time at the first conversion; of the configuration it takes the
            chip's identity alone. A board that asked for a reset boots again with its memory.
    """
    if binary is None:
        return NativeBoard
    # The emulator is loaded by those who want it only.
    from hil_sim.board.elf.board import ElfBoard  # noqa: PLC0415
    from hil_sim.board.elf.wiring import NUCLEO, NUCLEO_ADXL355  # noqa: PLC0415

    made: list[ElfBoard] = []

    def make(config: BoardConfig) -> Board:
        if made and made[-1].reset_requested:
            made[-1].reboot()
        else:
            wiring = NUCLEO_ADXL355 if config.part == adxl355.PART else NUCLEO
            made[:] = [ElfBoard(binary, config, wiring=wiring)]
        return made[-1]

    return make
