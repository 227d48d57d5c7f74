"""A result of the bench test: a measured number, its bound, and what follows."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Result:
    """A row of the report.

    Attributes:
        what: what was measured.
        value: the number; None where nothing could be measured.
        unit: of value and bounds; empty for a count.
        low, high: the bounds that value must keep, themselves included; None: open on that side.
        detail: how it came about, or why it was not measured.
        silicon: what a real chip tells here that the emulator cannot know.
    """

    what: str
    value: float | None
    unit: str = ""
    low: float | None = None
    high: float | None = None
    detail: str = ""
    silicon: str = ""

    @property
    def passed(self) -> bool | None:
        """Within its bound; None where it was not measured."""
        if self.value is None:
            return None
        return (self.low is None or self.value >= self.low) and (self.high is None or self.value <= self.high)

    @property
    def verdict(self) -> str:
        """`ok`, `OUT OF BOUND` or `not measured`."""
        return {True: "ok", False: "OUT OF BOUND", None: "not measured"}[self.passed]

    @property
    def bound(self) -> str:
        """`0.5 to 1`, `at least 3`, `at most 250`, `exactly 32`."""
        if self.low is not None and self.low == self.high:
            return f"exactly {self.low:g}"
        if self.low is not None and self.high is not None:
            return f"{self.low:g} to {self.high:g}"
        if self.low is not None:
            return f"at least {self.low:g}"
        return "" if self.high is None else f"at most {self.high:g}"


def not_measured(what: str, why: str, silicon: str = "") -> Result:
    """A row that says why it has no number."""
    return Result(what, None, detail=why, silicon=silicon)
