"""What the page shows of the load's force: means over a hundredth of a second, and the running stiffness."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from impid_host.view.stream import SHOWN_HZ, rounded

_MOST_POINTS = 1000  # that wait for the next push
_MOST_LOOKS = 100


class ForceShown:
    """Rows and looks of the observer in, points for the page out; bounded, whatever comes in."""

    def __init__(self) -> None:
        self._words = "starting"
        self._rest = np.zeros((0, 0))  # t, force: of the hundredth that is not over yet
        self._points = np.zeros((0, 0))
        self._looks: list[dict[str, Any]] = []

    def take(self, message: Mapping[str, Any], first_us: int | None) -> None:
        """A message of the observer.

        Args:
            first_us: the module's clock where the page's time begins; None before the first sample.
        """
        if message["kind"] == "observer":
            self._words = message["words"]
        elif first_us is None:
            return
        elif message["kind"] == "force":
            t = np.array(message["board_s"]) - first_us * 1e-6
            self._add(np.column_stack([t, np.array(message["force"])]))
        elif message["kind"] == "stiffness":
            board_s = message["board_s"]
            t_s = None if board_s is None else round(board_s - first_us * 1e-6, 3)
            self._looks = [*self._looks, {**message, "t": t_s}][-_MOST_LOOKS:]

    def _add(self, rows: np.ndarray) -> None:
        if self._rest.shape[1] != rows.shape[1]:
            self._rest, self._points = rows[:0], rows[:0]
        rows = np.concatenate([self._rest, rows])
        place = np.floor(rows[:, 0] * SHOWN_HZ)
        over = place < place[-1]
        self._rest = rows[~over]
        starts = np.flatnonzero(np.diff(place[over], prepend=np.nan) != 0)
        if len(starts):
            counts = np.diff(np.append(starts, over.sum()))
            means = np.add.reduceat(rows[over], starts, axis=0) / counts[:, None]
            self._points = np.concatenate([self._points, means])[-_MOST_POINTS:]

    def state(self, skipped: int) -> dict[str, Any]:
        """What came since the last call, and how the observer fares."""
        points, self._points = self._points, self._points[:0]
        looks, self._looks = self._looks, []
        words = f"{self._words}; {skipped} pieces of samples left out" if skipped else self._words
        return {
            "words": words,
            "t": rounded(points[:, 0], 9) if points.size else [],
            "force": [rounded(column) for column in points[:, 1:].T] if points.size else [],
            "looks": looks,
        }
