"""One word on how a recording goes: good, or what is wrong and what to do about it."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from impid_host.samples import FLAG_ENCODER_FAULT, FLAG_LATE, FLAG_SATURATED

Level = Literal["good", "look", "bad"]
_LATELY_S = 10.0  # for how long a trouble is shown after it has ended
_SILENT_S = 1.5
_CLOCK_S = 15.0  # by then the clocks of board and host have been matched
_STILL_S = 5.0  # a converter's code moves by its own noise in far less


@dataclass(frozen=True, slots=True)
class Light:
    """What the lamp shows: its level, and a sentence for each trouble, the worst first."""

    level: Level
    words: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """For the page."""
        return {"level": self.level, "words": list(self.words)}


@dataclass(slots=True)
class Lamp:
    """Remembers for a while what went wrong. Times are of one monotonic clock, s."""

    _flagged: dict[int, float] = field(default_factory=dict)  # flag -> when last seen
    _lost: deque[tuple[float, int, int]] = field(default_factory=deque)  # when, lost and damaged so far
    _heard: float | None = None
    _moved: list[float] = field(default_factory=lambda: [0.0, 0.0])
    _last: list[int | None] = field(default_factory=lambda: [None, None])

    def see(self, now: float, flags: int, first: tuple[int, int], *, constant: tuple[bool, bool]) -> None:
        """A piece of the stream.

        Args:
            flags: of all its samples together.
            first: code of its first sample on each axis; constant: whether all its codes are that one.
        """
        self._heard = now
        for flag in (FLAG_SATURATED, FLAG_ENCODER_FAULT, FLAG_LATE):
            if flags & flag:
                self._flagged[flag] = now
        for axis in (0, 1):
            if not constant[axis] or first[axis] != self._last[axis]:
                self._moved[axis] = now
            self._last[axis] = first[axis]

    def progress(self, now: float, told: Mapping[str, Any]) -> None:
        """How the recording stands, as the recorder says it."""
        self._lost.append((now, int(told["lost"]), int(told["damaged"])))
        while len(self._lost) > 1 and self._lost[1][0] < now - _LATELY_S:
            self._lost.popleft()

    def light(self, now: float, told: Mapping[str, Any]) -> Light:
        """What to show now.

        Args:
            told: the recorder's last word; empty before the first.
        """
        if not told:
            return Light("look", ("waiting for the recorder",))
        bad, look = self._bad(now, told), self._look(now, told)
        level: Level = "bad" if bad else "look" if look else "good"
        return Light(level, (*bad, *look) or ("recording, nothing is wrong",))

    def _bad(self, now: float, told: Mapping[str, Any]) -> list[str]:
        if not told["connected"]:
            return ["the board is gone, waiting for it: check cable and power"]
        words = []
        silent = self._heard is None or now - self._heard > _SILENT_S
        if silent:
            words.append("no samples arrive: check cable and power")
        lately = self._lost_lately()
        if lately > 0:
            words.append(f"{lately} samples lost in the last {_LATELY_S:.0f} s: other cable, fewer programs")
        if self._lately(now, FLAG_SATURATED):
            words.append("the acceleration was at its end: move more gently, or check the sensor's wiring")
        if self._lately(now, FLAG_ENCODER_FAULT):
            words.append("an encoder reports a fault: check its cable")
        if not silent:
            still = [name for name, since in zip("xy", self._moved, strict=True) if now - since > _STILL_S]
            if still:
                words.append(
                    f"acceleration {' and '.join(still)} stands on one code: is the sensor connected?"
                )
        return words

    def _look(self, now: float, told: Mapping[str, Any]) -> list[str]:
        words = []
        lost = int(told["lost"])
        if lost > self._lost_lately():
            words.append(f"{lost} samples lost so far; the recording says where")
        if self._lost and self._lost[-1][2] > self._lost[0][2]:
            words.append("damaged frames arrive: check the cable")
        if self._lately(now, FLAG_LATE):
            words.append("some samples are late: the board was busy")
        if told["clock"] is None and float(told["elapsed_s"]) > _CLOCK_S:
            words.append("the board's clock is not determined yet")
        return words

    def _lost_lately(self) -> int:
        return self._lost[-1][1] - self._lost[0][1] if self._lost else 0

    def _lately(self, now: float, flag: int) -> bool:
        return flag in self._flagged and now - self._flagged[flag] < _LATELY_S
