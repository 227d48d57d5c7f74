"""Builds `impid_host.wire._native`, the hot loops of the serial decoder in C.

Run by setup.py through cffi. Where there is no compiler the host decodes in Python alone, unless the variable
IMPID_SIM is 1.
"""

import os
import re
import sys
from pathlib import Path

from cffi import FFI

# The build runs in the root of the source tree, where setup.py is.
_FOLDER = "host/impid_host/wire"
_FLAGS = [] if sys.platform == "win32" else ["-O3", "-std=c11", "-Wall", "-Wextra", "-Wconversion"]


def _declarations() -> str:
    text = Path(_FOLDER, "native.h").read_text(encoding="utf-8")
    return re.sub(r"^\s*#.*$", "", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL), flags=re.MULTILINE)


ffibuilder = FFI()
ffibuilder.cdef(_declarations())
ffibuilder.set_source(
    "impid_host.wire._native",
    '#include <stddef.h>\n#include <stdint.h>\n#include "native.h"\n',
    sources=[f"{_FOLDER}/native.c"],
    include_dirs=[_FOLDER],
    depends=[f"{_FOLDER}/native.h"],
    extra_compile_args=_FLAGS,
    optional=os.environ.get("IMPID_SIM") != "1",
)
