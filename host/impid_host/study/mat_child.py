"""Reads a MATLAB 4 to 7 file in a process of its own: `python -m ...mat_child IN.mat OUT.npz`.

scipy says of its reader that it is not hardened: a damaged file can crash Python or claim all memory.
Here that costs a child process with bounded memory, and the user still gets an error line. OUT.npz takes each
real numeric array under its name, a field of a structure under `structure.field`, of the k-th of several
under `structure[k].field`, and the names of variables that are objects. Exit status 2: stderr says what is
wrong.
"""

import sys
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAX_ARRAY_BYTES = 1 << 30
MAX_DEPTH = 6
MAX_ENTRIES = 10_000
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


def numeric_arrays(path: str) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """The real numeric arrays of a file by name, and the variables that are objects.

    Raises:
        ValueError: an array claims too much memory; and whatever the reader raises on a broken file.
    """
    import scipy.io  # noqa: PLC0415  (in the child alone)

    wanted, objects = [], []
    for name, shape, kind in scipy.io.whosmat(path):
        size = float(np.prod(shape, dtype=float))
        if kind in (*_NUMERIC_CLASSES, "struct") and size * 8 > MAX_ARRAY_BYTES:
            raise ValueError(f"variable {name} claims more than one trial can hold")
        if kind in (*_NUMERIC_CLASSES, "struct"):
            wanted.append(name)
        elif kind in ("object", "opaque"):
            objects.append(name)
    found: dict[str, NDArray[Any]] = {}
    for name, value in scipy.io.loadmat(path, variable_names=wanted).items():
        if name in wanted:
            _collect(name, value, 0, found)
    return found, objects


def _collect(name: str, value: object, depth: int, found: dict[str, NDArray[Any]]) -> None:
    """Note the real numeric arrays in `value`, which is one, or a structure, or an array of structures."""
    if not isinstance(value, np.ndarray) or depth > MAX_DEPTH or len(found) >= MAX_ENTRIES:
        return
    if value.dtype.names is None:
        if value.dtype.kind in "iufb":
            found[name] = value
        return
    if type(value) is not np.ndarray:  # an object, not a structure
        return
    elements = value.ravel(order="F")
    for number, element in enumerate(elements, start=1):
        which = name if len(elements) == 1 else f"{name}[{number}]"
        for field in value.dtype.names:
            _collect(f"{which}.{field}", element[field], depth + 1, found)


def main(path: str, out: str) -> int:
    """Write the arrays of `path` to `out`; the exit status."""
    _limit_memory()
    warnings.simplefilter("ignore")
    try:
        arrays, objects = numeric_arrays(path)
    except Exception as error:  # the reader lets through whatever a broken file provokes
        reason = (str(error).splitlines() or [type(error).__name__])[0][:120]
        sys.stderr.write(reason or type(error).__name__)
        return 2
    # Numbered, because a variable's name need not be a file name; the names go into an array of their own.
    names = np.array(list(arrays), dtype=np.str_)
    numbered: dict[str, Any] = {f"a{i}": array for i, array in enumerate(arrays.values())}
    np.savez(out, names=names, objects=np.array(objects, dtype=np.str_), **numbered)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2]))
