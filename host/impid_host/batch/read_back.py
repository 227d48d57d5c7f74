"""Results read back as rows: what `compare` works on in place of studies."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from impid_host.batch.data_set import ENDING
from impid_host.batch.places import Place, is_address, place
from impid_host.errors import InputError
from impid_host.sessions.row import Row
from impid_host.study.names import distinct_names

_NAMES = tuple(own.name for own in fields(Row))
_BESIDE = ("place", "fitted_at", "checks")


@dataclass(frozen=True, slots=True)
class Results:
    """The rows of numbers, the places of their studies, and studies about which something is impossible."""

    rows: tuple[Row, ...]
    places: tuple[str, ...]
    impossible: tuple[str, ...]


def is_data_set(path: str) -> bool:
    """Whether results lie there: an address, a Parquet file, or a folder of such that is no study."""
    if is_address(path) or path.endswith(ENDING):
        return True
    folder = Path(path)
    return folder.is_dir() and not (folder / "setup.toml").exists() and any(folder.glob(f"*{ENDING}"))


def read_results(path: str) -> Results:
    """The rows of a data set, or of a long table that `compare --table` wrote.

    Of two results of one place the later counts; studies of one name are told apart by their folders.

    Raises:
        InputError: there is nothing, or a file is no such table.
    """
    above, _, last = path.rpartition("/")
    alone = path.endswith(ENDING)
    folder = place((above or ".") if alone else path)
    names = [last] if alone else [name for name in folder.names() if name.endswith(ENDING)]
    if not names:
        raise InputError(path, "holds no results", "make them with: impid-host batch STUDIES... --out FOLDER")
    tables = [_read(folder, name) for name in names]
    rows = _latest([row for table in tables for row in table])
    called = distinct_names({row.get("place") or row["study"]: row["study"] for row in rows})
    for row in rows:
        row["study"] = called[row.get("place") or row["study"]]
    wrong = dict.fromkeys(
        row["study"]
        for row in rows
        if any(check["verdict"] == "impossible" for check in row.get("checks") or ())
    )
    places = dict.fromkeys(row["place"] for row in rows if "place" in row)
    numbers = tuple(_row(row) for row in rows if row["value"] is not None)
    return Results(numbers, tuple(places), tuple(wrong))


def _latest(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Without what a later result of the same place replaces."""
    latest: dict[str, Any] = {}
    for row in rows:
        if "place" in row:
            at = latest.setdefault(row["place"], row["fitted_at"])
            latest[row["place"]] = max(at, row["fitted_at"])
    return [row for row in rows if "place" not in row or row["fitted_at"] == latest[row["place"]]]


def _read(folder: Place, name: str) -> list[dict[str, Any]]:
    import pyarrow as pa  # noqa: PLC0415  (slow to import)
    from pyarrow import parquet  # noqa: PLC0415

    data = folder.read(name)
    where = f"{folder.address}/{name}"
    remedy = "give what `impid-host batch` or `compare --table` wrote"
    try:
        file = parquet.ParquetFile(pa.BufferReader(data))
        there = set(file.schema_arrow.names)
        missing = [column for column in _NAMES if column not in there]
        if missing:
            raise InputError(where, f"has no column {missing[0]}", remedy)
        read = file.read(columns=[column for column in (*_NAMES, *_BESIDE) if column in there])
    except pa.ArrowException as error:
        raise InputError(where, f"is no Parquet file ({error})", remedy) from None
    rows: list[dict[str, Any]] = read.to_pylist()
    return rows


def _row(row: dict[str, Any]) -> Row:
    date = row["date"]
    texts = {"date": date if isinstance(date, str) else "" if date is None else date.isoformat()}
    return Row(**{name: row[name] for name in _NAMES} | texts)
