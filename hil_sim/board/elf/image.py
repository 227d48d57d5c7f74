"""The binary that ships, laid into the flash of an emulated chip."""

from pathlib import Path

from elftools.common.exceptions import ELFError
from elftools.elf.elffile import ELFFile

from hil_sim.board.elf.memory import Memory
from hil_sim.errors import SimError


def flash(path: Path) -> Memory:
    """A chip's memory with a program in its flash, everything else erased.

    Raises:
        SimError: the file is absent, or is no ELF for an Arm microcontroller.
    """
    memory = Memory()
    try:
        with path.open("rb") as stream:
            elf = ELFFile(stream)
            if elf["e_machine"] != "EM_ARM" or elf.elfclass != 32:
                raise SimError(
                    f"{path}: not a program for an Arm microcontroller; build it with `make firmware`"
                )
            for segment in elf.iter_segments():
                if segment["p_type"] == "PT_LOAD" and segment["p_filesz"]:
                    memory.write_flash(segment["p_paddr"], segment.data())
    except OSError as error:
        raise SimError(f"{path}: {error.strerror}; build the firmware with `make firmware`") from error
    except ELFError as error:
        raise SimError(
            f"{path}: not an ELF file ({error}); build the firmware with `make firmware`"
        ) from error
    return memory
