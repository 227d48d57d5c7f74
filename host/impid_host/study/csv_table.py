"""Numeric columns of a CSV file: fast where the file is good, exact to the row and column where it is not.

A study of 80 trials holds millions of rows, so `pyarrow` reads the columns that were asked for and no others.
It cannot say which line is at fault, nor can it read `12.0` as an integer. When it refuses, the careful
reader goes through the file cell by cell: either it finds the fault and names it, or there is none.
"""

import codecs
import csv
import itertools
import math
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pyarrow as pa
import pyarrow.csv
from numpy.typing import NDArray

from impid_host.errors import InputError
from impid_host.study.notices import notice
from impid_host.study.text_clock import across_midnight, clock_seconds

# 2 GiB of robot log is half a day at 1 kHz: no trial, and more than a small computer can hold as columns.
MAX_CSV_BYTES = 2 << 30
_MAX_LINE_CHARACTERS = 1 << 16
_MISSING = ("", "nan", "NaN", "NAN", "NA", "null")
_BLANKS = "whitespace"
# Python's own float() also takes 1_000 and digits of other scripts, which no logger writes.
_NUMBER = re.compile(
    r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?|[+-]?(inf|infinity|nan)", re.IGNORECASE
)


@dataclass(frozen=True, slots=True)
class CsvDialect:
    """How a CSV file is written; the defaults are those of the study folder.

    Attributes:
        delimiter: one character, or "whitespace" for any run of blanks and tabs.
        decimal: decimal point.
        header: whether the first line (after `skip_rows`) names the columns; else they are called 1, 2, ...
        skip_rows: lines to pass over at the top.
        comment: lines that begin with this are passed over.
    """

    delimiter: str = ","
    decimal: str = "."
    header: bool = True
    skip_rows: int = 0
    comment: str | None = None

    @property
    def plain(self) -> bool:
        """Whether pyarrow knows how to read it."""
        return self.delimiter != _BLANKS and self.comment is None and self.skip_rows == 0


STUDY_DIALECT = CsvDialect()


@dataclass(frozen=True, slots=True)
class CsvTable:
    """Columns by name, each of shape (N,), and where they came from."""

    path: Path
    columns: Mapping[str, NDArray[Any]]
    dialect: CsvDialect = STUDY_DIALECT

    def row(self, index: int) -> int:
        """The 1-based line of the file that holds data row `index` (counting blank and comment lines too)."""
        with _open(self.path) as file:
            lines = _filled_lines(file, self.dialect)
            found = next(itertools.islice(lines, index + int(self.dialect.header), None), None)
        return index + 2 if found is None else found[0]


def read_header(path: Path, dialect: CsvDialect = STUDY_DIALECT) -> list[str]:
    """The column names of a CSV file, stripped of blanks; 1, 2, ... where it has none.

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
        encoding = _encoding(path)
        with _open(path) as file:
            row, line = next(_filled_lines(file, dialect), (1, ""))
    except FileNotFoundError:
        raise InputError(path, "does not exist", "check the path") from None
    except OSError as error:
        raise InputError(
            path, f"cannot be read ({error.strerror})", "check the path and its permissions"
        ) from None
    if not line:
        raise InputError(path, "is empty", "the log was never written; copy it again or record it again")
    if "\0" in line or len(line) >= _MAX_LINE_CHARACTERS:
        raise InputError(path, "is no CSV text", "check that this is the right file", row=row)
    try:
        names = _cells(line, dialect)
    except csv.Error as error:
        raise InputError(path, f"has a broken header ({error})", "correct it", row=row) from None
    if encoding == "latin-1":
        notice(f"{path}: is not UTF-8; read as Latin-1")
    return names if dialect.header else [str(i + 1) for i in range(len(names))]


def read_columns(
    path: Path,
    wanted: Mapping[str, np.dtype[Any]],
    *,
    header: Sequence[str],
    may_be_empty: Sequence[str] = (),
    clocks: Sequence[str] = (),
    dialect: CsvDialect = STUDY_DIALECT,
    broken: dict[int, InputError] | None = None,
) -> CsvTable:
    """Read the columns `wanted` (name -> dtype) of a CSV file whose header is `header`, in any order.

    An empty cell or NaN is an error in every column but those of `may_be_empty`, where it becomes NaN. In a
    column of `clocks` a time such as 14:03:07.125 becomes seconds. With `broken`, cells of columns of floats
    that cannot be read become NaN, and what is wrong is noted there by data row.

    Raises:
        InputError: a column is missing or there twice, a cell holds no number that fits, or there is no row.
    """
    _check_header(path, wanted, header)
    columns = _read_fast(path, wanted, header, dialect)
    if columns is None or any(_has_nan(columns[name]) for name in wanted if name not in may_be_empty):
        cells = [
            _Column(name, header.index(name), dtype, name in may_be_empty, name in clocks)
            for name, dtype in wanted.items()
        ]
        columns = _read_carefully(path, cells, len(header), dialect, broken)
    if len(next(iter(columns.values()))) == 0:
        raise InputError(path, "has a header but no rows", "the log was never filled; record it again")
    return CsvTable(path, columns, dialect)


def _check_header(path: Path, wanted: Mapping[str, np.dtype[Any]], header: Sequence[str]) -> None:
    missing = [name for name in wanted if name not in header]
    if missing:
        there = ", ".join(header) if len(header) <= 30 else ", ".join(header[:30]) + ", ..."
        remedy = hint_at_delimiter(header) or (
            "write comma-separated columns with these names, or use `impid-host import`"
        )
        raise InputError(path, f"has no column {', '.join(missing)} (it has: {there})", remedy, row=1)
    twice = [name for name in wanted if header.count(name) > 1]
    if twice:
        raise InputError(path, f"has column {twice[0]} twice", "rename or remove one of them", row=1)


def hint_at_delimiter(header: Sequence[str]) -> str:
    """What to say in a mapping where the whole header looks like one name; else nothing."""
    if len(header) == 1:
        for character, written in ((";", ";"), ("\t", "\\t"), (",", ","), (" ", "whitespace")):
            if character in header[0]:
                return (
                    f'the columns are separated otherwise: say [log] delimiter = "{written}" in a mapping '
                    "for `impid-host import`"
                )
    return ""


def _read_fast(
    path: Path, wanted: Mapping[str, np.dtype[Any]], header: Sequence[str], dialect: CsvDialect
) -> dict[str, NDArray[Any]] | None:
    """The columns as pyarrow reads them, or None where it refuses."""
    if not dialect.plain or _encoding(path) == "utf-16":
        return None
    # Positions stand for names, so that unnamed and repeated columns beside the wanted ones do no harm.
    positions = {name: str(header.index(name)) for name in wanted}
    try:
        table = pa.csv.read_csv(
            path,
            read_options=pa.csv.ReadOptions(
                column_names=[str(i) for i in range(len(header))],
                skip_rows=int(dialect.header),
                block_size=1 << 22,
            ),
            parse_options=pa.csv.ParseOptions(delimiter=dialect.delimiter),
            convert_options=pa.csv.ConvertOptions(
                column_types={positions[name]: pa.from_numpy_dtype(dtype) for name, dtype in wanted.items()},
                include_columns=list(positions.values()),
                null_values=list(_MISSING),
                decimal_point=dialect.decimal,
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


@dataclass(frozen=True, slots=True)
class _Column:
    """A column to read: its name and place, what it holds, and what else a cell may be."""

    name: str
    place: int
    dtype: np.dtype[Any]
    optional: bool
    clock: bool


def _read_carefully(
    path: Path,
    wanted: Sequence[_Column],
    width: int,
    dialect: CsvDialect,
    broken: dict[int, InputError] | None,
) -> dict[str, NDArray[Any]]:
    """The columns cell by cell.

    Raises:
        InputError: at the first cell that holds no fitting number, unless `broken` takes it.
    """
    values: dict[str, array[Any]] = {column.name: array(column.dtype.char) for column in wanted}
    clocks: set[str] = set()
    for index, (row, cells) in enumerate(_rows(path, dialect)):
        if len(cells) != width:
            error = _wrong_width(path, row, cells, width, dialect)
            if broken is None:
                raise error
            broken.setdefault(index, error)
        for column in wanted:
            written = cells[column.place] if column.place < len(cells) else ""
            text = written if dialect.decimal == "." else written.replace(dialect.decimal, ".")
            try:
                if column.clock and ":" in text:
                    values[column.name].append(_clock(path, row, column.name, text))
                    clocks.add(column.name)
                else:
                    values[column.name].append(_number(path, row, column, text))
            except InputError as error:
                if broken is None or column.dtype.kind != "f":
                    raise
                broken.setdefault(index, error)
                values[column.name].append(math.nan)
    columns = {
        column.name: np.frombuffer(values[column.name], dtype=column.dtype).copy() for column in wanted
    }
    return columns | {name: across_midnight(columns[name]) for name in clocks}


def _wrong_width(path: Path, row: int, cells: list[str], width: int, dialect: CsvDialect) -> InputError:
    remedy = "complete or delete that row (a cut-off last row is what a power cut leaves)"
    if dialect.delimiter == "," and any(";" in cell for cell in cells):
        remedy = (
            'if cells are separated by semicolons, say [log] delimiter = ";" (and decimal = ",") in a mapping'
        )
    elif dialect.delimiter == "," and len(cells) > width:
        remedy += '; a decimal comma needs [log] decimal = "," and another delimiter in a mapping'
    what = f"has {len(cells)} cells where there are {width} columns"
    return InputError(path, what, remedy, row=row)


def _clock(path: Path, row: int, name: str, text: str) -> float:
    try:
        return clock_seconds(text)
    except ValueError:
        remedy = "write it as HH:MM:SS.mmm, or as seconds"
        raise InputError(path, f"column {name} holds {text[:40]!r}, not a time", remedy, row=row) from None


def _open(path: Path) -> TextIO:
    return path.open(encoding=_encoding(path), errors="replace")


def _filled_lines(file: TextIO, dialect: CsvDialect) -> Iterator[tuple[int, str]]:
    """(1-based line, text) of each line that is neither blank, skipped nor a comment."""
    for number, line in enumerate(iter(lambda: file.readline(_MAX_LINE_CHARACTERS), ""), start=1):
        text = line.strip("\r\n")
        if number > dialect.skip_rows and text.strip() and not _is_comment(text, dialect):
            yield number, text


def _is_comment(text: str, dialect: CsvDialect) -> bool:
    return dialect.comment is not None and text.lstrip().startswith(dialect.comment)


def _cells(text: str, dialect: CsvDialect) -> list[str]:
    if dialect.delimiter == _BLANKS:
        return text.split()
    return [cell.strip() for cell in next(csv.reader([text], delimiter=dialect.delimiter))]


def _rows(path: Path, dialect: CsvDialect) -> Iterator[tuple[int, list[str]]]:
    """(1-based line, cells) of each filled row after the header."""
    with _open(path) as file:
        for row, text in itertools.islice(_filled_lines(file, dialect), int(dialect.header), None):
            try:
                yield row, _cells(text, dialect)
            except csv.Error as error:
                raise InputError(path, f"is no CSV text ({error})", "correct that row", row=row) from None


def _number(path: Path, row: int, column: _Column, text: str) -> float | int:
    name, dtype = column.name, column.dtype
    shown = text if len(text) <= 40 else text[:37] + "..."
    if text in _MISSING:
        if column.optional:
            return math.nan
        raise InputError(
            path, f"column {name} is empty or NaN", "delete that row or repair the value", row=row
        )
    try:
        value = float(_plain(text)) if dtype.kind == "f" else _whole(_plain(text))
    except ValueError:
        kind = "a number" if dtype.kind == "f" else "a whole number"
        raise InputError(path, f"column {name} holds {shown!r}, not {kind}", _remedy(text), row=row) from None
    if dtype.kind == "f":
        if math.isnan(value) and not column.optional:
            raise InputError(path, f"column {name} is NaN", "delete that row or repair the value", row=row)
        return value
    limits = np.iinfo(dtype)
    if not limits.min <= value <= limits.max:
        between = f"it must lie between {limits.min} and {limits.max}"
        raise InputError(path, f"column {name} holds {shown}", between, row=row)
    return value


def _remedy(text: str) -> str:
    """What to do about a cell that is no number: often the dialect is another than was said."""
    if _NUMBER.fullmatch(text.replace(",", ".", 1)) is not None:
        return 'a decimal comma is read with [log] decimal = "," (and delimiter = ";") in a mapping'
    parts = [part.strip() for part in re.split(r"[;\t ]+", text) if part.strip()]
    if len(parts) > 1 and all(_NUMBER.fullmatch(part.replace(",", ".")) for part in parts):
        character = ";" if ";" in text else "\\t" if "\t" in text else "whitespace"
        return f'the cells are separated otherwise: say [log] delimiter = "{character}" in a mapping'
    return "correct that value"


def _plain(text: str) -> str:
    if _NUMBER.fullmatch(text) is None:
        raise ValueError(text)
    return text


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
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    try:
        codecs.getincrementaldecoder("utf-8-sig")().decode(start, final=len(start) < 1 << 16)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def write_columns(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write columns of equal length as CSV; floats in the shortest exact form, NaN as an empty cell."""
    arrays = [pa.array(column, from_pandas=True) for column in columns.values()]
    table = pa.table(arrays, names=list(columns))
    with path.open("wb") as file:
        file.write((",".join(columns) + "\n").encode())
        pa.csv.write_csv(table, file, pa.csv.WriteOptions(include_header=False, quoting_style="none"))
