"""A log of another program, whatever its file format: named numeric columns, read one at a time."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

import numpy as np
import pyarrow as pa
import pyarrow.parquet
from numpy.typing import NDArray

from impid_host.errors import InputError
from impid_host.study.c3d_log import read_c3d
from impid_host.study.csv_table import CsvDialect, CsvTable, hint_at_delimiter, read_columns, read_header
from impid_host.study.mat_log import Hdf5Log, MatLog
from impid_host.study.mdf_log import read_mdf
from impid_host.study.rosbag_log import bag_of, read_bag
from impid_host.study.xdf_log import read_xdf

# Columns larger than this do not come from one trial; a hostile file may merely claim them.
MAX_COLUMN_BYTES = 1 << 30


class ForeignLog(Protocol):
    """Named columns of equal or different length."""

    path: Path

    def names(self) -> list[str]:
        """The columns there are."""
        ...

    def column(self, name: str) -> NDArray[np.float64]:
        """One of them, shape (N,), NaN where a cell is empty. Raises InputError where it holds no numbers."""
        ...

    def row(self, index: int) -> int:
        """The 1-based row of the file that holds element `index`."""
        ...

    def broken(self) -> Mapping[int, InputError]:
        """What was wrong in cells that came out as NaN, by element; as far as columns were read."""
        ...

    def hint(self) -> str:
        """What may be the reason where a column is missing; "" where nothing is known."""
        ...


class CsvLog:
    """A text log in the dialect that the mapping describes."""

    def __init__(self, path: Path, dialect: CsvDialect) -> None:
        self.path = path
        self._dialect = dialect
        self._header = read_header(path, dialect)
        self._columns: dict[str, NDArray[np.float64]] = {}
        self._broken: dict[int, InputError] = {}

    def names(self) -> list[str]:
        return self._header

    def column(self, name: str) -> NDArray[np.float64]:
        if name not in self._columns:
            types = {name: np.dtype(np.float64)}
            table = read_columns(
                self.path,
                types,
                header=self._header,
                may_be_empty=(name,),
                clocks=(name,),
                dialect=self._dialect,
                broken=self._broken,
            )
            self._columns[name] = np.asarray(table.columns[name], dtype=np.float64)
        return self._columns[name]

    def row(self, index: int) -> int:
        return CsvTable(self.path, {}, self._dialect).row(index)

    def broken(self) -> Mapping[int, InputError]:
        return self._broken

    def hint(self) -> str:
        return hint_at_delimiter(self._header)


class ParquetLog:
    """A Parquet file; time stamps become seconds since 1970."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = pa.parquet.ParquetFile(path)
            self._types = {field.name: field.type for field in self._file.schema_arrow}
        except (pa.ArrowException, OSError, ValueError) as error:
            reason = str(error).splitlines()[0][:120]
            raise InputError(
                path, f"is no readable Parquet file ({reason})", "check or export it again"
            ) from None
        if self._file.metadata.num_rows * 8 > MAX_COLUMN_BYTES:
            raise InputError(path, "claims more rows than one trial can hold", "cut the log into trials")

    def names(self) -> list[str]:
        return [name for name, kind in self._types.items() if _is_number(kind)]

    def column(self, name: str) -> NDArray[np.float64]:
        try:
            values = self._file.read(columns=[name])[name]
            if pa.types.is_timestamp(values.type):
                unit = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[values.type.unit]
                return np.asarray(values.cast(pa.int64()).to_numpy(), dtype=np.float64) * unit
            return np.asarray(values.to_numpy(), dtype=np.float64)
        except (pa.ArrowException, OSError, ValueError, KeyError) as error:
            reason = (str(error).splitlines() or [""])[0][:120]
            raise InputError(
                self.path, f"column {name} cannot be read ({reason})", "export it again"
            ) from None

    def row(self, index: int) -> int:
        return index + 1

    def broken(self) -> Mapping[int, InputError]:
        return {}

    def hint(self) -> str:
        return ""


def _is_number(kind: pa.DataType) -> bool:
    tests = (pa.types.is_integer, pa.types.is_floating, pa.types.is_boolean, pa.types.is_timestamp)
    return any(test(kind) for test in tests)


_WHOLE: dict[str, Callable[[Path], ForeignLog]] = {"xdf": read_xdf, "mdf": read_mdf, "c3d": read_c3d}


def open_log(path: Path, file_format: str, dialect: CsvDialect) -> ForeignLog:
    """Open a log; `file_format` is "csv", "parquet", "mat", "rosbag", "xdf", "mdf", "c3d", or "auto"
    to judge by the file.

    Raises:
        InputError: the file is missing, empty, or not what it should be.
    """
    bag = bag_of(path) if file_format in ("auto", "rosbag") else None
    if bag is not None:
        return read_bag(bag)
    try:
        if path.is_dir():
            raise InputError(path, "is a folder", "give the log files themselves")
        with path.open("rb") as file:
            start = file.read(520)
    except FileNotFoundError:
        raise InputError(path, "does not exist", "check the path") from None
    except OSError as error:
        raise InputError(
            path, f"cannot be read ({error.strerror})", "check the path and its permissions"
        ) from None
    if not start:
        raise InputError(path, "is empty", "the log was never written; copy it again or record it again")
    kind = _kind(path, start) if file_format == "auto" else file_format
    if kind in _WHOLE:
        return _WHOLE[kind](path)
    if kind == "parquet":
        return ParquetLog(path)
    if kind == "mat":
        is_hdf5 = start.startswith(b"\x89HDF") or start[512:516] == b"\x89HDF"
        return Hdf5Log(path) if is_hdf5 else MatLog(path)
    return CsvLog(path, dialect)


def _kind(path: Path, start: bytes) -> str:
    if start.startswith(b"PAR1") or path.suffix.lower() == ".parquet":
        return "parquet"
    if start.startswith((b"MATLAB", b"\x89HDF")) or path.suffix.lower() in (".mat", ".h5", ".hdf5"):
        return "mat"
    if start.startswith(b"XDF:") or path.suffix.lower() == ".xdf":
        return "xdf"
    if start.startswith(b"MDF ") or path.suffix.lower() in (".mf4", ".mdf"):
        return "mdf"
    if start[1:2] == b"\x50" and path.suffix.lower() == ".c3d":
        return "c3d"
    return "csv"
