"""How far the board is behind the wall clock, and what was done about it."""

from dataclasses import dataclass, field
from typing import Any

NOTICEABLE_S = 0.1
GIVE_UP_S = 2.0
COMPLAIN_EVERY_S = 5.0


@dataclass
class LagMeter:
    """Book of the lag; all times in seconds on the wall.

    The lag is bounded: more than GIVE_UP_S is not caught up with. The board's clock then stands still for
    that long against the wall, which `slipped_s` says.
    """

    worst_s: float = 0.0
    behind_s: float = 0.0
    slipped_s: float = 0.0
    _complain_at_s: float = field(default=0.0, repr=False)

    def observe(self, behind_s: float, since_last_s: float) -> float:
        """Books one turn of the loop.

        Args:
            behind_s: how far behind the board is.
            since_last_s: how long ago the turn before was.

        Returns:
            How much to give up, 0 nearly always.
        """
        self.worst_s = max(self.worst_s, behind_s)
        if behind_s > NOTICEABLE_S:
            self.behind_s += since_last_s
        if behind_s <= GIVE_UP_S:
            return 0.0
        self.slipped_s += behind_s
        return behind_s

    def complaint_is_due(self, behind_s: float, now_s: float) -> bool:
        """Whether to say so now: at most every five seconds."""
        if behind_s <= NOTICEABLE_S or now_s < self._complain_at_s:
            return False
        self._complain_at_s = now_s + COMPLAIN_EVERY_S
        return True

    def report(self) -> dict[str, Any]:
        """For the event lines."""
        return {
            "worst_s": round(self.worst_s, 3),
            "behind_s": round(self.behind_s, 3),
            "slipped_s": round(self.slipped_s, 3),
        }
