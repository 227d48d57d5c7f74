"""A channel of a free-running timer as an output (RM0390 17.3.8 to 17.3.10): toggle at a match, or forced low.

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
        self.mode = FROZEN

    def set_mode(self, mode: int) -> None:
        """OC1M: FROZEN, TOGGLE or FORCE_LOW."""
        self.keep()
        self.mode = mode
        if mode == FORCE_LOW:
            self._level = False

    def keep(self) -> None:
        """To be called before anything changes that decides the level."""
        now = self._timer.soc.schedule.now
        self._level = self._at(now)
        self._since = now

    def level(self, cycle: int) -> bool:
        """Of the pin, if one is switched to the channel."""
        return bool(self._timer.value["CCER"] & CC1E) and self._at(cycle)

    def _at(self, cycle: int) -> bool:
        overflow = self._timer.next_update()
        if self.mode != TOGGLE or overflow is None:
            return self._level
        step = self._timer.soc.rcc.timer_divider(1) * (self._timer.value["PSC"] + 1)
        period = step * (self._timer.value["ARR"] + 1)
        match = (
            overflow - period + step * self._timer.value["CCR1"]
        )  # one of them; the others are periods away
        matches = (cycle - match) // period - (self._since - match) // period
        return self._level ^ bool(matches % 2)
