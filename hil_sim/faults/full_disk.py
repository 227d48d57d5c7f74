"""A disk that is full: the kernel refuses a program's writes beyond so many bytes of a file."""

import shutil

from hil_sim.errors import SimError


def full_after(file_bytes: int, command: list[str]) -> list[str]:
    """The command that runs `command` so that no file of it grows beyond file_bytes.

    A write beyond that fails with EFBIG, as it does with ENOSPC on a full disk; bytes up to it are on disk.

    Raises:
        SimError: this machine has no prlimit (util-linux).
    """
    prlimit = shutil.which("prlimit")
    if prlimit is None:
        raise SimError("prlimit is not installed; on Debian: sudo apt-get install util-linux")
    return [prlimit, f"--fsize={file_bytes}", *command]
