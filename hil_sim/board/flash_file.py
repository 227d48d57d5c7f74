"""The flash of a simulated board in a file, so that stored settings outlive the simulator."""

from mmap import mmap
from pathlib import Path

from hil_sim.board.native import FLASH_BYTES, new_flash
from hil_sim.errors import SimError


def open_flash(path: Path) -> mmap:
    """The file's content as writable memory; a file that is not there is made, as a chip leaves the factory.

    Raises:
        SimError: it cannot be made or written on, or is no flash of a board.
    """
    try:
        if not path.exists():
            path.write_bytes(bytes(new_flash()))
        with path.open("r+b") as file:
            size = path.stat().st_size
            if size != FLASH_BYTES:
                raise SimError(
                    f"{path}: {size} bytes are no flash of a board ({FLASH_BYTES}); name a new file"
                )
            return mmap(file.fileno(), FLASH_BYTES)
    except OSError as error:
        raise SimError(f"{path}: {error.strerror}; name a place that can be written to") from None
