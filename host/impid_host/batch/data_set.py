"""The results as a Parquet data set: a file for each study, a row for each number.

A file is called `<place>-<key>.parquet`, the key made of data, options and version: the folder's listing
alone says what is done. What is broken, and tried again, ends in `.again.parquet`.
"""

import datetime
from dataclasses import fields
from typing import Any

from impid_host.batch.places import Place
from impid_host.batch.task import BROKEN, Answer, BatchOptions, place_key
from impid_host.sessions.row import Row

ENDING, _AGAIN = ".parquet", ".again.parquet"
_TEXT_OF_STUDY = ("study", "subject", "side", "date", "posture")


class DataSet:
    """The folder of results."""

    def __init__(self, folder: Place) -> None:
        self.folder = folder
        self._names = {name for name in folder.names() if name.endswith(ENDING)}
        self._by_key = {_parts(name)[1]: name for name in self._names if not name.endswith(_AGAIN)}
        self._current: dict[str, str] = {}

    @property
    def known(self) -> frozenset[str]:
        """Keys of the results that need no second try."""
        return frozenset(self._by_key)

    def add(self, answer: Answer, options: BatchOptions, command: str) -> None:
        """Write a study's result, unless it is there, and remember it as the one of its place.

        Where the study could not be read at all, an older result of its place stays: nothing newer is known.
        """
        place_of, broken = place_key(answer.place), answer.status in BROKEN
        if not answer.key and any(_parts(name)[0] == place_of for name in self._names):
            return
        name = self._by_key.get(answer.key)
        if name is None:
            name = f"{place_of}-{answer.key or 'unread'}{_AGAIN if broken else ENDING}"
            self.folder.write(name, as_parquet(answer, options, command))
            self._names.add(name)
            if not broken:
                self._by_key[answer.key] = name
        self._current[place_of] = name

    def drop_superseded(self) -> int:
        """Remove older results of the places that have a new one; how many there were."""
        current = set(self._current.values())
        old = [n for n in self._names if _parts(n)[0] in self._current and n not in current]
        for name in old:
            self.folder.remove(name)
        self._names -= set(old)
        return len(old)


def _parts(name: str) -> tuple[str, str]:
    """Place and key of a file's name."""
    before, _, key = name.removesuffix(ENDING).removesuffix(".again").partition("-")
    return before, key


def as_parquet(answer: Answer, options: BatchOptions, command: str) -> bytes:
    """The file of one study: a row for each number, or one without a number where there is none."""
    import pyarrow as pa  # noqa: PLC0415  (slow to import)
    from pyarrow import parquet  # noqa: PLC0415

    names = [own.name for own in fields(Row)]
    numbers = [dict(zip(names, row, strict=True)) for row in answer.rows]
    if not numbers:
        numbers = [
            dict(zip(_TEXT_OF_STUDY, (answer.study, *answer.session), strict=True)) | {"trusted": False}
        ]
    shared = {
        "place": answer.place,
        "status": answer.status,
        "verdict": answer.verdict,
        "checks": list(answer.checks),
        "effects": list(answer.effects),
        "why": answer.why,
        "remedy": answer.remedy,
        "notices": list(answer.notices),
        "key": answer.key,
        "data_sha256": answer.data_sha256,
        **{name: answer.versions.get(name, "") for name in _VERSIONS},
        "options": options.to_json(),
        "command": command,
        "fitted_at": datetime.datetime.now(datetime.UTC),
        "seconds": answer.seconds,
        "worker": answer.worker,
    }
    table = pa.Table.from_pylist(
        [shared | own | {"date": _date(own["date"])} for own in numbers], _schema(pa)
    )
    sink = pa.BufferOutputStream()
    parquet.write_table(table, sink)
    return bytes(sink.getvalue())


_VERSIONS = ("impid", "python", "numpy", "scipy")


def _date(text: str) -> datetime.date | None:
    return datetime.date.fromisoformat(text) if text else None


def _schema(pa: Any) -> Any:
    """The columns; docs/batch.md says what is in them."""
    text, number = pa.string(), pa.float64()
    check = pa.struct([(name, text) for name in ("what", "where", "verdict", "words")])
    kinds = {
        **dict.fromkeys(("value", "low", "high", "sd", "seconds"), number),
        "date": pa.date32(),
        "trusted": pa.bool_(),
        "checks": pa.list_(check),
        **dict.fromkeys(("effects", "notices"), pa.list_(text)),
        "fitted_at": pa.timestamp("us", tz="UTC"),
    }
    of_study = ("place", "status", "verdict", "checks", "effects", "why", "remedy", "notices")
    of_run = ("key", "data_sha256", *_VERSIONS, "options", "command", "fitted_at", "seconds", "worker")
    names = [own.name for own in fields(Row)] + [*of_study, *of_run]
    return pa.schema([(name, kinds.get(name, text)) for name in names])
