"""Statuses as rows of numbers: an hour has 36,000, and most are never looked at."""

from collections.abc import Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from impid_host.wire.messages import STATUS, MessageLayout, Words
from impid_host.wire.records import BoardStatus


class Statuses(Sequence[BoardStatus]):
    """Statuses in order, each made when it is asked for.

    Args:
        headers: of the frames, structured as BATCH, shape (N,).
        words: the STATUS messages of each, shape (N, 8), of which the first `sent` (N,) came.
    """

    __hash__ = None  # type: ignore[assignment]  # they compare as lists do

    def __init__(self, headers: NDArray[Any], words: Words, sent: NDArray[np.int64]) -> None:
        self._headers, self._words, self._sent = headers, words, sent

    @classmethod
    def of(cls, headers: NDArray[Any], rows: Sequence[tuple[int, Words]]) -> "Statuses":
        """From rows, each with the number of its frame's header; an older board sends fewer words."""
        words = np.zeros((len(rows), len(STATUS)), np.uint64)
        sent = np.zeros(len(rows), np.int64)
        for n, (_, row) in enumerate(rows):
            sent[n] = min(len(row), len(STATUS))
            words[n, : sent[n]] = row[: sent[n]]
        return cls(headers[[number for number, _ in rows]], words, sent)

    @classmethod
    def joined(cls, parts: "Sequence[Statuses]") -> "Statuses":
        """Parts in order; at least one."""
        return cls(
            np.concatenate([part._headers for part in parts]),
            np.concatenate([part._words for part in parts]),
            np.concatenate([part._sent for part in parts]),
        )

    def told(self) -> tuple[NDArray[Any], ...]:
        """boot_id, t_us, next_index and produced, each (N,)."""
        layout = STATUS[0]
        produced = layout.unpack(self._words[:, 0])["produced"]
        return self._headers["boot_id"], self._headers["t0_us"], self._headers["first_index"], produced

    def __len__(self) -> int:
        return len(self._words)

    @overload
    def __getitem__(self, which: int) -> BoardStatus: ...
    @overload
    def __getitem__(self, which: slice) -> "Statuses": ...
    def __getitem__(self, which: int | slice) -> "BoardStatus | Statuses":
        if isinstance(which, slice):
            return Statuses(self._headers[which], self._words[which], self._sent[which])
        signals: dict[str, int] = {}
        for layout, word in zip(STATUS[: self._sent[which]], self._words[which].tolist(), strict=False):
            signals |= scalars(layout, word)
        header = self._headers[which]
        boot_id, t_us, next_index = (int(header[name]) for name in ("boot_id", "t0_us", "first_index"))
        return BoardStatus(boot_id, t_us, next_index, **signals)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)


def scalars(layout: MessageLayout, word: int) -> dict[str, int]:
    """Signals of one message as Python integers."""
    return {name: (word >> shift) & mask for name, (shift, mask) in layout.fields.items()}
