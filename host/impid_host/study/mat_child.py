"""Reads a MATLAB 4 to 7 file in a process of its own: `python -m ...mat_child IN.mat OUT.npz`.

scipy says of its reader that it is not hardened: a damaged file can crash Python or claim all memory.
Here that costs a child process with bounded memory, and the user still gets an error line. OUT.npz takes each
real numeric array under its name, a field of a structure under `structure.field`. Exit status 2: stderr says
what is wrong.
"""

import sys
import warnings
from typing import Any

import numpy as np
import scipy.io
from numpy.typing import NDArray

MAX_ARRAY_BYTES = 1 << 30
MAX_MEMORY_BYTES = 8 << 30
_NUMERIC_CLASSES = (
    "double", "single", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "logical"
)  # fmt: skip


def _limit_memory() -> None:
    try:
        import resource  # noqa: PLC0415  (not on Windows)
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY_BYTES, MAX_MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def numeric_arrays(path: str) -> dict[str, NDArray[Any]]:
    """The real numeric arrays of a file by name.

    Raises:
        ValueError: an array claims too much memory; and whatever the reader raises on a broken file.
    """
    wanted = []
    for name, shape, kind in scipy.io.whosmat(path):
        size = float(np.prod(shape, dtype=float))
        if kind in _NUMERIC_CLASSES and size * 8 > MAX_ARRAY_BYTES:
            raise ValueError(f"variable {name} claims more than one trial can hold")
        if kind in _NUMERIC_CLASSES or (kind == "struct" and size == 1):
            wanted.append(name)
    found: dict[str, NDArray[Any]] = {}
    for name, value in scipy.io.loadmat(path, variable_names=wanted).items():
        if name in wanted and isinstance(value, np.ndarray):
            found |= _fields(name, value)
    return found


def _fields(name: str, value: NDArray[Any]) -> dict[str, NDArray[Any]]:
    if value.dtype.names is None:
        return {name: value} if value.dtype.kind in "iufb" else {}
    fields = {f"{name}.{field}": value[field].item() for field in value.dtype.names}
    return {
        key: field
        for key, field in fields.items()
        if isinstance(field, np.ndarray) and field.dtype.kind in "iufb"
    }


def main(path: str, out: str) -> int:
    """Write the arrays of `path` to `out`; the exit status."""
    _limit_memory()
    warnings.simplefilter("ignore")
    try:
        arrays = numeric_arrays(path)
    except Exception as error:  # the reader lets through whatever a broken file provokes
        reason = (str(error).splitlines() or [type(error).__name__])[0][:120]
        sys.stderr.write(reason or type(error).__name__)
        return 2
    # Numbered, because a variable's name need not be a file name; the names go into an array of their own.
    names = np.array(list(arrays), dtype=np.str_)
    numbered: dict[str, Any] = {f"a{i}": array for i, array in enumerate(arrays.values())}
    np.savez(out, names=names, **numbered)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2]))
