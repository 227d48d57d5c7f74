"""A channel of a free-running timer as an output (RM0390 17.3.8 to 17.3.10): toggled at a match, or low.

Nothing happens at a match: the level at any instant is counted from the matches since the mode was set.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil_sim.board.elf.timer import Timer

CC1E = 1
MODE_AT, MODE_MASK = 4, 7 << 4  # OC1M
FROZEN, TOGGLE, FORCE_LOW = 0, 3, 4


class CompareOutput:
    """Channel 1 of a timer."""

    def __init__(self, timer: "Timer") -> None:
        self._timer = timer
        self._level = False
        self._since = 0
        self._match, self._period = 0, 0  # a cycle at which the counter matches, and how often it does
        self.mode = FROZEN

    def set_mode(self, mode: int) -> None:
        """OC1M: FROZEN, TOGGLE or FORCE_LOW; the counter runs."""
        self._keep()
        self.mode = mode
        self._level = self._level and mode != FORCE_LOW
        self._place()

    def set_match(self, count: int) -> None:
        """CCR1, at once."""
        self._keep()
        self._timer.value["CCR1"] = count
        self._place()

    def level(self, cycle: int) -> bool:
        """Of the pin, if one is switched to the channel."""
        return bool(self._timer.value["CCER"] & CC1E) and self._at(cycle)

    def _keep(self) -> None:
        now = self._timer.soc.schedule.now
        self._level, self._since = self._at(now), now

    def _place(self) -> None:
        update = self._timer.next_update()
        if update is not None:
            step = self._timer.soc.rcc.timer_divider(1) * (self._timer.value["PSC"] + 1)
            self._period = step * (self._timer.value["ARR"] + 1)
            self._match = update + step * self._timer.value["CCR1"]

    def _at(self, cycle: int) -> bool:
        if self.mode != TOGGLE:
            return self._level
        matches = (cycle - self._match) // self._period - (self._since - self._match) // self._period
        return self._level ^ bool(matches % 2)
