"""Builds `hil_sim._chip`: the part of the emulator that runs at every block, event and access.

Optional as `hil_sim._native` is.
"""

import os
import re
import sys
from pathlib import Path

from cffi import FFI

# The build runs in the root of the source tree, where setup.py is.
FOLDER = "hil_sim/board/elf"
SOURCES = (
    "block_clock", "schedule", "nvic", "run", "gpio", "dma", "timer", "adc", "usart", "can",
    "can_registers", "iwdg", "world"
)  # fmt: skip
WARNINGS = [] if sys.platform == "win32" else ["-O2", "-std=c11", "-Wall", "-Wextra", "-Wconversion"]


def declarations(header: str) -> str:
    """What a header declares, without comments and preprocessor."""
    text = re.sub(r"/\*.*?\*/", "", Path(FOLDER, header).read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.sub(r"^\s*#.*$", "", text, flags=re.MULTILINE)


text = declarations("block_clock.h") + declarations("chip.h")
callbacks = re.findall(r"^extern (.*;)$", text, flags=re.MULTILINE)

ffibuilder = FFI()
ffibuilder.cdef(re.sub(r"^extern .*;$", "", text, flags=re.MULTILINE))
ffibuilder.cdef('extern "Python+C" {' + "".join(callbacks) + "}")
ffibuilder.set_source(
    "hil_sim._chip",
    '#include "chip.h"\n',
    sources=[f"{FOLDER}/{name}.c" for name in SOURCES],
    include_dirs=[FOLDER],
    extra_compile_args=WARNINGS,
    libraries=[] if sys.platform == "win32" else ["m"],
    optional=os.environ.get("IMPID_SIM") != "1",
)
