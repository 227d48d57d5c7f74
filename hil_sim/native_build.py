"""Builds `hil_sim._native`: the firmware core, its native board, and the plant, as one extension.

Run by setup.py through cffi. Where there is no compiler the host is installed without the simulator, unless
the variable IMPID_SIM is 1. The declarations that Python sees are read from the C headers themselves, so
there is no second copy of them to keep in step.
"""

import os
import re
import sys
from pathlib import Path

from cffi import FFI

# The build runs in the root of the source tree, where setup.py is.
INCLUDE_DIRS = [
    "firmware/core",
    "firmware/generated",
    "firmware/boards/native",
    "hil_sim/plant",
]
HEADERS = [
    "firmware/boards/native/impid_board.h",
    "hil_sim/plant/effects.h",
    "hil_sim/plant/plant.h",
]
# -O3 unrolls the stages of the integration: a third faster than -O2 (bench/plant_speed.py).
FLAGS = [] if sys.platform == "win32" else ["-O3", "-std=c11", "-Wall", "-Wextra", "-Wconversion"]


def declarations(header: str) -> str:
    """The declarations of a header as cffi reads them: no comments, no preprocessor, its numbers put in."""
    text = re.sub(r"/\*.*?\*/", "", Path(header).read_text(encoding="utf-8"), flags=re.DOTALL)
    for name, number in re.findall(r"^#define (\w+)\s+(\d+)u?\s*$", text, flags=re.MULTILINE):
        text = re.sub(rf"\b{name}\b", number, text)
    return re.sub(r"^\s*#.*$", "", text, flags=re.MULTILINE)


def sources() -> list[str]:
    """Every C file of the extension, relative to the root of the source tree."""
    found = [str(path) for folder in INCLUDE_DIRS for path in sorted(Path(folder).glob("*.c"))]
    return [path.replace("\\", "/") for path in found]


ffibuilder = FFI()
for header in HEADERS:
    ffibuilder.cdef(declarations(header))
ffibuilder.set_source(
    "hil_sim._native",
    "".join(f'#include "{Path(header).name}"\n' for header in HEADERS),
    sources=sources(),
    include_dirs=INCLUDE_DIRS,
    depends=[str(path) for folder in INCLUDE_DIRS for path in sorted(Path(folder).glob("*.h"))],
    extra_compile_args=FLAGS,
    libraries=[] if sys.platform == "win32" else ["m"],
    optional=os.environ.get("IMPID_SIM") != "1",
)
