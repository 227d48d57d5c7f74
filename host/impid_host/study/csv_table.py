"""Numeric columns of a CSV file: fast where the file is good, exact to the row and column where it is not.

A study of 80 trials holds millions of rows, so `pyarrow` reads the columns that were asked for and no others.
It cannot say which line is at fault, nor can it read `12.0` as an integer. When it refuses, the careful
reader goes through the file cell by cell: it either finds the fault and names it, or finds that there is none.
"""

import csv
import io
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
from numpy.typing import NDArray

from impid_host.errors import InputError
from impid_host.study.notices import notice

# 2 GiB of robot log is half a day at 1 kHz: no trial, and more than a small computer can hold as columns.
MAX_CSV_BYTES = 2 << 30
_MAX_HEADER_CHARACTERS = 1 << 16
_MISSING = ("", "nan", "NaN", "NAN", "NA", "null")


@dataclass(frozen=True, slots=True)
class CsvTable:
    """Columns by name, each of shape (N,), and where they came from."""

    path: Path
    columns: Mapping[str, NDArray[Any]]

    def row(self, index: int) -> int:
        """The 1-based line of the file that holds data row `index` (counting blank lines too)."""
        encoding = _encoding(self.path)
        with self.path.open(encoding=encoding, errors="replace") as file:
            filled = (number for number, line in enumerate(file, start=1) if line.strip())
            return next(itertools.islice(filled, index + 1, None), index + 2)


def read_header(path: Path) -> list[str]:
    """The column names of a CSV file, stripped of blanks.

    Raises:
        InputError: the file is missing, empty, too large, or no text.
    """
    try:
        size = path.stat().st_size
        if not path.is_file():
            raise InputError(path, "is not a file", "give the path of a CSV file")
        if size > MAX_CSV_BYTES:
            raise InputError(
                path, f"is {size >> 20} MiB long", "cut the log into trials of less than 2 GiB each"
            )
        with path.open(encoding=_encoding(path), errors="replace") as file:
            line = file.readline(_MAX_HEADER_CHARACTERS)
    except FileNotFoundError:
        raise InputError(path, "does not exist", "check the path") from None
    except OSError as error:
        raise InputError(
            path, f"cannot be read ({error.strerror})", "check the path and its permissions"
        ) from None
    if not line.strip():
        raise InputError(
            path, "is empty", "the log was never written, or its first line is blank; copy it again"
        )
    if "\0" in line or len(line) >= _MAX_HEADER_CHARACTERS:
        raise InputError(path, "is no CSV text", "check that this is the right file", row=1)
    try:
        return [name.strip() for name in next(csv.reader([line]))]
    except csv.Error as error:
        raise InputError(path, f"has a broken header ({error})", "correct it", row=1) from None


def read_columns(
    path: Path,
    wanted: Mapping[str, np.dtype[Any]],
    *,
    may_be_empty: Sequence[str] = (),
    header: Sequence[str],
) -> CsvTable:
    """Read the columns `wanted` (name -> dtype) of a CSV file whose header is `header`, in any order.

    An empty cell or NaN is an error in every column but those of `may_be_empty`, where it becomes NaN.

    Raises:
        InputError: a column is missing or there twice, a cell holds no number that fits, or there is no row.
    """
    _check_header(path, wanted, header)
    columns = _read_fast(path, wanted, header)
    if columns is None or any(_has_nan(columns[name]) for name in wanted if name not in may_be_empty):
        columns = _read_carefully(path, wanted, may_be_empty, header)
    if len(next(iter(columns.values()))) == 0:
        raise InputError(path, "has a header but no rows", "the log was never filled; record it again")
    return CsvTable(path, columns)


def _check_header(path: Path, wanted: Mapping[str, np.dtype[Any]], header: Sequence[str]) -> None:
    missing = [name for name in wanted if name not in header]
    if missing:
        there = ", ".join(header) if len(header) <= 30 else ", ".join(header[:30]) + ", ..."
        remedy = "write comma-separated columns with these names, or use `impid-host import`"
        raise InputError(path, f"has no column {', '.join(missing)} (it has: {there})", remedy, row=1)
    twice = [name for name in wanted if header.count(name) > 1]
    if twice:
        raise InputError(path, f"has column {twice[0]} twice", "rename or remove one of them", row=1)


def _read_fast(
    path: Path, wanted: Mapping[str, np.dtype[Any]], header: Sequence[str]
) -> dict[str, NDArray[Any]] | None:
    """The columns as pyarrow reads them, or None where it refuses."""
    if _encoding(path) == "utf-16":
        return None
    # Positions stand for names, so that unnamed and repeated columns beside the wanted ones do no harm.
    positions = {name: str(header.index(name)) for name in wanted}
    try:
        table = pa.csv.read_csv(
            path,
            read_options=pa.csv.ReadOptions(
                column_names=[str(i) for i in range(len(header))], skip_rows=1, block_size=1 << 22
            ),
            convert_options=pa.csv.ConvertOptions(
                column_types={positions[name]: pa.from_numpy_dtype(dtype) for name, dtype in wanted.items()},
                include_columns=list(positions.values()),
                null_values=list(_MISSING),
            ),
        )
    except (pa.ArrowException, OSError):
        return None
    columns: dict[str, NDArray[Any]] = {}
    for name, dtype in wanted.items():
        column = table[positions[name]]
        if column.null_count and dtype.kind != "f":
            return None
        columns[name] = column.to_numpy().astype(dtype, copy=False)
    return columns


def _read_carefully(
    path: Path, wanted: Mapping[str, np.dtype[Any]], may_be_empty: Sequence[str], header: Sequence[str]
) -> dict[str, NDArray[Any]]:
    """The columns cell by cell.

    Raises:
        InputError: at the first cell that holds no fitting number.
    """
    places = [(name, header.index(name), dtype, name in may_be_empty) for name, dtype in wanted.items()]
    values: dict[str, list[float | int]] = {name: [] for name in wanted}
    for row, cells in _rows(path):
        if len(cells) != len(header):
            remedy = "complete or delete that row (a cut-off last row is what a power cut leaves)"
            raise InputError(
                path, f"has {len(cells)} cells where the header has {len(header)}", remedy, row=row
            )
        for name, place, dtype, optional in places:
            values[name].append(
                _number(path, row, name, cells[place].strip(), dtype=dtype, optional=optional)
            )
    return {name: np.array(values[name], dtype=dtype) for name, dtype in wanted.items()}


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """(1-based line, cells) of each filled row after the header."""
    encoding = _encoding(path)
    if encoding == "latin-1":
        notice(f"{path}: is not UTF-8; read as Latin-1")
    with path.open(encoding=encoding, errors="replace", newline="") as file:
        reader = csv.reader(io.StringIO(file.read().replace("\r\n", "\n").replace("\r", "\n")))
        try:
            next(reader, None)
            for cells in reader:
                if any(cell.strip() for cell in cells):
                    yield reader.line_num, cells
        except csv.Error as error:
            raise InputError(
                path, f"is no CSV text ({error})", "correct that row", row=reader.line_num
            ) from None


def _number(
    path: Path, row: int, name: str, text: str, *, dtype: np.dtype[Any], optional: bool
) -> float | int:
    shown = text if len(text) <= 40 else text[:37] + "..."
    if text in _MISSING:
        if optional:
            return math.nan
        raise InputError(
            path, f"column {name} is empty or NaN", "delete that row or repair the value", row=row
        )
    try:
        value = float(text) if dtype.kind == "f" else _whole(text)
    except ValueError:
        kind = "a number" if dtype.kind == "f" else "a whole number"
        raise InputError(
            path, f"column {name} holds {shown!r}, not {kind}", "correct that value", row=row
        ) from None
    if dtype.kind == "f":
        if math.isnan(value) and not optional:
            raise InputError(path, f"column {name} is NaN", "delete that row or repair the value", row=row)
        return value
    limits = np.iinfo(dtype)
    if not limits.min <= value <= limits.max:
        between = f"it must lie between {limits.min} and {limits.max}"
        raise InputError(path, f"column {name} holds {shown}", between, row=row)
    return value


def _whole(text: str) -> int:
    """The integer a cell holds; `12.0`, as spreadsheets and data frames write it, is one too."""
    try:
        return int(text)
    except ValueError:
        value = float(text)
    # Beyond 2**53 a float no longer says which integer was meant.
    if not value.is_integer() or abs(value) > 2**53:
        raise ValueError(text)
    return int(value)


def _has_nan(column: NDArray[Any]) -> bool:
    return column.dtype.kind == "f" and bool(np.isnan(column).any())


def _encoding(path: Path) -> str:
    with path.open("rb") as file:
        start = file.read(1 << 16)
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        start[:-4].decode("utf-8-sig") if len(start) == 1 << 16 else start.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        return "utf-8-sig" if len(start) == 1 << 16 and error.start >= len(start) - 8 else "latin-1"
    return "utf-8-sig"


def write_columns(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write columns of equal length as CSV; floats in the shortest exact form, NaN as an empty cell."""
    arrays = [pa.array(column, from_pandas=True) for column in columns.values()]
    table = pa.table(arrays, names=list(columns))
    with path.open("wb") as file:
        file.write((",".join(columns) + "\n").encode())
        pa.csv.write_csv(table, file, pa.csv.WriteOptions(include_header=False, quoting_style="none"))
