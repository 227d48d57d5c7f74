"""MATLAB files: version 5 through scipy, version 7.3 (which is HDF5) through h5py.

Only real numeric arrays are taken, by name, after their claimed size was checked. Cells, objects, function
handles and links out of the file are not followed. A field of a structure is named `structure.field`, of the
second in an array of structures `structure[2].field`, as deep as they are nested; the columns of a matrix are
named `matrix[1]`, `matrix[2]`, ... along its shorter side. So the values of Simulink's "Structure With Time"
are `out.time` and `out.signals.values`, or `out.signals[2].values`.
"""

import itertools
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impid_host.errors import InputError
from impid_host.extras import extra
from impid_host.study.mat_child import MAX_DEPTH
from impid_host.study.mat_inflation import inflates_beyond

MAX_FILE_BYTES = 1 << 30
MAX_ARRAY_BYTES = 1 << 30
MAX_INFLATED_BYTES = 1 << 29
MAX_MATRIX_COLUMNS = 256
_MAX_ENTRIES = 10_000
_CHILD_SECONDS = 120


def _columns_of(name: str, shape: tuple[int, ...]) -> list[str]:
    """The columns that an array of this shape gives, by name; none where it is no vector or narrow matrix."""
    sides = [side for side in shape if side != 1]
    if len(sides) <= 1:
        return [name]
    if len(sides) == 2 and min(sides) <= MAX_MATRIX_COLUMNS:
        return [f"{name}[{i + 1}]" for i in range(min(sides))]
    return []


def _pick(array: NDArray[Any], index: int | None) -> NDArray[np.float64]:
    matrix = np.squeeze(array)
    if index is None:
        return np.atleast_1d(matrix).astype(np.float64)
    return (matrix[:, index] if matrix.shape[0] >= matrix.shape[1] else matrix[index]).astype(np.float64)


def _too_large(path: Path, name: str) -> InputError:
    return InputError(path, f"variable {name} claims more than one trial can hold", "cut the log into trials")


def _hint_at_objects(objects: list[str]) -> str:
    if not objects:
        return ""
    name = objects[0]
    return (
        f"{', '.join(objects[:5])} is an object (a timeseries or a data set), which only MATLAB reads: save "
        f"its numbers, such as {name}_s = struct('time', {name}.Time, 'data', {name}.Data)"
    )


def _split(name: str) -> tuple[str, int | None]:
    if name.endswith("]") and "[" in name:
        variable, _, index = name[:-1].rpartition("[")
        return variable, int(index) - 1
    return name, None


class MatLog:
    """A MATLAB file of version 4 to 7, read by a child process: scipy's reader may crash on a damaged one."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if path.stat().st_size > MAX_FILE_BYTES:
            raise InputError(path, "is larger than 1 GiB", "cut the log into trials")
        if inflates_beyond(path, MAX_INFLATED_BYTES):
            raise InputError(path, "unpacks to more than one trial can hold", "cut the log into trials")
        self._objects: list[str] = []
        self._arrays = self._read_in_child()
        self._names = [
            column for name, array in self._arrays.items() for column in _columns_of(name, array.shape)
        ]

    def names(self) -> list[str]:
        return self._names

    def column(self, name: str) -> NDArray[np.float64]:
        variable, index = _split(name)
        return _pick(self._arrays[variable], index)

    def row(self, index: int) -> int:
        return index + 1

    def broken(self) -> Mapping[int, InputError]:
        return {}

    def hint(self) -> str:
        return _hint_at_objects(self._objects)

    def _read_in_child(self) -> dict[str, NDArray[Any]]:
        with tempfile.TemporaryDirectory(prefix="impid-mat-") as folder:
            out = Path(folder) / "arrays.npz"
            command = [sys.executable, "-m", "impid_host.study.mat_child", str(self.path.resolve()), str(out)]
            try:
                done = subprocess.run(command, capture_output=True, timeout=_CHILD_SECONDS, check=False)
            except subprocess.TimeoutExpired:
                raise self._unreadable(f"no end after {_CHILD_SECONDS} s") from None
            if done.returncode == 2:
                raise self._unreadable(done.stderr.decode(errors="replace").replace("\n", " ")[:120])
            if done.returncode != 0:
                raise self._unreadable("damaged so that the reader crashed on it")
            with np.load(out, allow_pickle=False) as arrays:
                self._objects = [str(name) for name in arrays["objects"]]
                return {str(name): arrays[f"a{i}"] for i, name in enumerate(arrays["names"])}

    def _unreadable(self, reason: str) -> InputError:
        remedy = "check it, or save it again with -v7 or -v7.3"
        return InputError(self.path, f"is no readable MATLAB file ({reason})", remedy)


class Hdf5Log:
    """A MATLAB file of version 7.3, or any HDF5 file; a dataset in a group is named `group.dataset`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._h5py = extra("h5py", f"{path} (MATLAB 7.3, HDF5)")
        self._datasets: dict[str, str] = {}
        self._names: list[str] = []
        self._seen: set[int] = set()
        self._objects: list[str] = []
        with self._opened() as file:
            self._collect(file, "", 0)

    def names(self) -> list[str]:
        return self._names

    def column(self, name: str) -> NDArray[np.float64]:
        variable, index = _split(name)
        with self._opened() as file:
            try:
                return _pick(file[self._datasets[variable]][()], index)
            except (OSError, ValueError, KeyError, RuntimeError, MemoryError) as error:
                reason = (str(error).splitlines() or [""])[0][:120]
                raise InputError(
                    self.path, f"variable {name} cannot be read ({reason})", "save it again"
                ) from None

    def row(self, index: int) -> int:
        return index + 1

    def broken(self) -> Mapping[int, InputError]:
        return {}

    def hint(self) -> str:
        return _hint_at_objects(self._objects)

    def _opened(self) -> Any:
        try:
            return self._h5py.File(self.path, "r")
        except (OSError, ValueError, RuntimeError) as error:
            reason = (str(error).splitlines() or [""])[0][:120]
            remedy = "check it, or save it again with -v7.3"
            raise InputError(self.path, f"is no readable MATLAB 7.3 (HDF5) file ({reason})", remedy) from None

    def _collect(self, group: Any, prefix: str, depth: int) -> None:
        """Note the numeric datasets under `group`, following only links that stay inside the file."""
        # A group may be linked into itself; each is visited once.
        address = self._h5py.h5o.get_info(group.id).addr
        if address in self._seen or len(self._seen) > _MAX_ENTRIES:
            return
        self._seen.add(address)
        try:
            for name in itertools.islice(group, _MAX_ENTRIES):
                if name.startswith("#") or not isinstance(group.get(name, getlink=True), self._h5py.HardLink):
                    continue
                self._collect_item(group.get(name), prefix, name, depth)
        except (OSError, ValueError, KeyError, RuntimeError, TypeError) as error:
            reason = (str(error).splitlines() or [""])[0][:120]
            raise InputError(self.path, f"is a damaged HDF5 file ({reason})", "save it again") from None

    def _collect_item(self, item: Any, prefix: str, name: str, depth: int) -> None:
        dotted = f"{prefix}{name}"
        if isinstance(item, self._h5py.Group) and depth < MAX_DEPTH:
            self._collect(item, f"{dotted}.", depth + 1)
        elif not isinstance(item, self._h5py.Dataset) or len(self._datasets) > _MAX_ENTRIES:
            return
        elif "MATLAB_object_decode" in item.attrs:
            self._objects.append(dotted)
        elif self._h5py.check_ref_dtype(item.dtype) is self._h5py.Reference:
            # A field of an array of structures: a reference to the value of each. Cells are not followed.
            if prefix and item.attrs.get("MATLAB_class") is None and item.size <= _MAX_ENTRIES:
                for number, reference in enumerate(item[()].ravel(), start=1):
                    if reference:
                        self._collect_item(item.file[reference], f"{prefix[:-1]}[{number}].", name, depth)
        elif self._is_numeric(item):
            self._datasets[dotted] = item.name
            self._names += _columns_of(dotted, item.shape)

    def _is_numeric(self, item: Any) -> bool:
        if item.attrs.get("MATLAB_class") in (b"char", "char"):
            return False
        if item.shape is None or item.dtype.kind not in "iufb" or item.is_virtual or item.external:
            return False
        if item.attrs.get("MATLAB_empty", 0):
            return False
        if np.prod(item.shape, dtype=float) * 8 > MAX_ARRAY_BYTES:
            raise _too_large(self.path, str(item.name))
        return True
