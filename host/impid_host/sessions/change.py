"""Did M, B or K change? Sessions on one day are repeats, and say how far two sessions differ by themselves.

Within a session the fit knows its noise, s. Mounting the arm anew adds more, with variance tau^2. Repeats on
one day scatter with variance S^2 = tau^2 + s^2, on average, with nu degrees of freedom, pooled over all days
and subjects. The change between two occasions then has the variance of both (tau^2 + s^2) / n, and Student's
t of nu degrees of freedom: with few repeats the interval is wide, as it must be. The minimal detectable
change of two single sessions is t sqrt(2) SEM, SEM^2 = max(S^2, s^2) (Weir, J. Strength Cond. Res. 19, 2005,
who has the normal distribution in place of t).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impid_host.sessions.row import Row
from impid_host.signals.quantiles import NORMAL_975, student_975

Key = tuple[str, str, str, str, str, str]


@dataclass(frozen=True, slots=True)
class Repeatability:
    """How far repeats of one quantity scatter.

    Attributes:
        sem: standard error of measurement of one session, noise and mounting together.
        tau: of it by mounting anew; zero where the repeats scatter no more than their noise.
        dof: degrees of freedom, repeats less days.
        mdc95: minimal detectable change between two single sessions.
    """

    sem: float
    tau: float
    dof: int
    mdc95: float


@dataclass(frozen=True, slots=True)
class Occasion:
    """The sessions of one day: their studies, mean, and standard deviation of the mean by noise alone."""

    date: str
    studies: tuple[str, ...]
    value: float
    noise_sd: float
    trusted: bool


@dataclass(frozen=True, slots=True)
class Change:
    """From the first occasion to a later one.

    Attributes:
        low, high: 95 % interval of the change; it holds the scatter of repeats where there are any.
        clear: the interval excludes zero, and repeats stand behind it; None where there were no repeats.
    """

    first: Occasion
    later: Occasion
    value: float
    low: float
    high: float
    clear: bool | None

    @property
    def percent(self) -> float:
        """Of the first value."""
        return 100 * self.value / self.first.value if self.first.value else float("nan")


@dataclass(frozen=True, slots=True)
class Series:
    """One quantity of one subject, side, posture and load, by one method, over the occasions."""

    subject: str
    side: str
    posture: str
    load: str
    method: str
    quantity: str
    unit: str
    rows: tuple[Row, ...]
    occasions: tuple[Occasion, ...]
    changes: tuple[Change, ...]
    repeatability: Repeatability | None

    @property
    def title(self) -> str:
        """Of whom and what."""
        who = [f"subject {self.subject}" if self.subject else "", self.side, self.posture, self.load]
        return ", ".join(part for part in who if part)


def compare(rows: Sequence[Row], *, steady: bool = False) -> list[Series]:
    """Every quantity of a load that at least two sessions measured.

    Args:
        rows: of all studies; those without a date are taken in their order, each a day of its own.
        steady: nothing changed from day to day, so that all sessions are repeats (a test-retest study).
    """
    groups: dict[Key, list[Row]] = {}
    for row in rows:
        if row.load:
            key = (row.subject, row.side, row.posture, row.load, row.method, row.quantity)
            groups.setdefault(key, []).append(row)
    several = {key: own for key, own in groups.items() if len({row.study for row in own}) > 1}
    scatter: dict[tuple[str, str], list[list[Row]]] = {}
    for key, own in several.items():
        days = [own] if steady else list(_days(own).values())
        scatter.setdefault((key[4], key[5]), []).extend(day for day in days if len(day) > 1)
    return [_series(key, own, repeatability(scatter[key[4], key[5]])) for key, own in several.items()]


def repeatability(days: Sequence[Sequence[Row]]) -> Repeatability | None:
    """Of repeats on several days, pooled; None without repeats."""
    dof = sum(len(day) - 1 for day in days)
    if dof == 0:
        return None
    squares = sum(float(np.sum((_values(day) - _values(day).mean()) ** 2)) for day in days)
    spread = squares / dof
    noise = float(np.mean([row.sd**2 for day in days for row in day]))
    sem = float(np.sqrt(max(spread, noise)))
    t = float(student_975(dof))
    return Repeatability(sem, float(np.sqrt(max(spread - noise, 0.0))), dof, t * float(np.sqrt(2)) * sem)


def _series(key: Key, own: Sequence[Row], repeats: Repeatability | None) -> Series:
    occasions = [_occasion(date, day) for date, day in _days(own).items()]
    changes = [_change(occasions[0], later, repeats) for later in occasions[1:]]
    return Series(*key, own[0].unit, tuple(own), tuple(occasions), tuple(changes), repeats)


def _days(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Rows by day, the earliest first; what has no date is a day of its own, in the order given."""
    days: dict[str, list[Row]] = {}
    for row in rows:
        days.setdefault(row.date or f"study {row.study}", []).append(row)
    dated = sorted(day for day in days if not day.startswith("study "))
    return {day: days[day] for day in [*dated, *(day for day in days if day.startswith("study "))]}


def _occasion(date: str, day: Sequence[Row]) -> Occasion:
    noise = float(np.sqrt(np.sum([row.sd**2 for row in day]))) / len(day)
    studies = tuple(row.study for row in day)
    return Occasion(date, studies, float(_values(day).mean()), noise, all(row.trusted for row in day))


def _change(first: Occasion, later: Occasion, repeats: Repeatability | None) -> Change:
    value = later.value - first.value
    variance = first.noise_sd**2 + later.noise_sd**2
    t = NORMAL_975
    if repeats is not None:
        variance += repeats.tau**2 * (1 / len(first.studies) + 1 / len(later.studies))
        t = float(student_975(repeats.dof))
    half = t * float(np.sqrt(variance))
    clear = None if repeats is None else abs(value) > half
    return Change(first, later, value, value - half, value + half, clear)


def _values(day: Sequence[Row]) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    return np.array([row.value for row in day])
