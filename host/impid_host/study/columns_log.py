"""A log that is read at once: named columns in memory, whatever library gave them."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from impid_host.errors import InputError

Columns = dict[str, NDArray[np.float64]]


class ColumnsLog:
    """The columns that a reader found in one file."""

    def __init__(self, path: Path, columns: Mapping[str, NDArray[np.float64]], hint: str = "") -> None:
        self.path = path
        self._columns = columns
        self._hint = hint

    def names(self) -> list[str]:
        return list(self._columns)

    def column(self, name: str) -> NDArray[np.float64]:
        return self._columns[name]

    def row(self, index: int) -> int:
        return index + 1

    def broken(self) -> Mapping[int, InputError]:
        return {}

    def hint(self) -> str:
        return self._hint


def unreadable(path: Path, kind: str, error: BaseException) -> InputError:
    """The one line in place of whatever a library raises on a damaged file."""
    reason = (str(error).splitlines() or [type(error).__name__])[0][:120]
    return InputError(path, f"is no readable {kind} file ({reason})", "check it, or export it again")


def beside_each_other(groups: list[tuple[str, Columns]]) -> Columns:
    """Columns of the only group as they are; of several, each with its group's name in front: `ARM.theta`.

    Groups of one name are counted: `ARM`, `ARM[2]`.
    """
    if len(groups) == 1:
        return groups[0][1]
    columns: Columns = {}
    met: dict[str, int] = {}
    for group, own in groups:
        met[group] = met.get(group, 0) + 1
        name = group if met[group] == 1 else f"{group}[{met[group]}]"
        columns |= {f"{name}.{column}": values for column, values in own.items()}
    return columns


def labelled(labels: list[str]) -> list[str]:
    """Names of columns by a file's labels: numbers where it has none, repeated ones counted."""
    met: dict[str, int] = {}
    names = []
    for number, label in enumerate(labels, start=1):
        name = label.strip() or str(number)
        met[name] = met.get(name, 0) + 1
        names.append(name if met[name] == 1 else f"{name}[{met[name]}]")
    return names
