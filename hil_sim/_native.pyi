# The C extension that native_build.py describes.
from typing import Any

ffi: Any
lib: Any
