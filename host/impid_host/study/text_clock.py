"""Times of day and dates as loggers write them, in seconds: 14:03:07.125, 2026-11-30 14:03:07, 01:02.5."""

import datetime
import re

import numpy as np

from impid_host.signals.arrays import Floats

_DAY_S = 86_400.0
_CLOCK = re.compile(
    r"(?:([0-9]{4}-[0-9]{2}-[0-9]{2})[T ]+)?(?:([0-9]{1,3}):)?([0-9]{1,2}):([0-9]{1,2}(?:[.,][0-9]*)?)Z?"
)
_EPOCH = datetime.date(1970, 1, 1)


def clock_seconds(text: str) -> float:
    """Seconds since midnight, or since 1970 where the text has a date; hours may be left out.

    Raises:
        ValueError: the text is no time.
    """
    found = _CLOCK.fullmatch(text.strip())
    if found is None:
        raise ValueError(text)
    day, hours, minutes, seconds = found.groups()
    days = 0 if day is None else (datetime.date.fromisoformat(day) - _EPOCH).days
    whole_text, _, fraction_text = seconds.replace(",", ".").partition(".")
    whole, fraction = int(whole_text), float(f"0.{fraction_text or 0}")
    if int(minutes) > 59 or whole > 60:
        raise ValueError(text)
    # Whole seconds first: a date's digits and those of a microsecond hardly fit one double.
    return float(days * 86_400 + int(hours or 0) * 3600 + int(minutes) * 60 + whole) + fraction


def across_midnight(seconds: Floats) -> Floats:
    """Times of day that go on after midnight, (N,): a fall by more than half a day begins the next."""
    result: Floats = seconds + _DAY_S * np.concatenate([[0.0], np.cumsum(np.diff(seconds) < -_DAY_S / 2)])
    return result
