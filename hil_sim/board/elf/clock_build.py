"""Builds `hil_sim._block_clock`: the part of the emulator that runs before every block of instructions."""

import re
import sys
from pathlib import Path

from cffi import FFI

# The build runs in the root of the source tree, where setup.py is.
FOLDER = "hil_sim/board/elf"
HEADER = Path(FOLDER, "block_clock.h")
WARNINGS = [] if sys.platform == "win32" else ["-O2", "-std=c11", "-Wall", "-Wextra", "-Wconversion"]

text = re.sub(r"/\*.*?\*/", "", HEADER.read_text(encoding="utf-8"), flags=re.DOTALL)

ffibuilder = FFI()
ffibuilder.cdef(re.sub(r"^\s*#.*$", "", text, flags=re.MULTILINE))
ffibuilder.set_source(
    "hil_sim._block_clock",
    '#include "block_clock.h"\n',
    sources=[f"{FOLDER}/block_clock.c"],
    include_dirs=[FOLDER],
    extra_compile_args=WARNINGS,
)
