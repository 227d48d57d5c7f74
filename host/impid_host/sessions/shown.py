"""A comparison as tables, JSON and plots."""

import datetime
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.table import Table

from impid_host.report.page.findings import Findings
from impid_host.report.page.plot import Line, Plot
from impid_host.report.page.section import Section
from impid_host.report.page.tables import of_terminal
from impid_host.sessions.change import Series, compare
from impid_host.sessions.long_table import rows_of

_MARK = " (!)"
_WORDS = {True: "changed", False: "no change beyond repeatability", None: "no repeats: unknown"}
_MATRICES = "mbk"


def comparison_table(series: Sequence[Series]) -> Table:
    """One row for each quantity and later occasion."""
    table = Table(
        title=f"{series[0].title}: {_METHOD[series[0].method]}",
        title_justify="left",
        caption_justify="left",
        caption=_caption(series),
    )
    for head in (
        "quantity",
        "from",
        "to",
        "first",
        "then",
        "change",
        "95 % interval",
        "%",
        "MDC",
        "unit",
        "",
    ):
        table.add_column(head, justify="left" if head in ("quantity", "unit", "") else "right")
    for own in series:
        for change in own.changes:
            mark = "" if change.first.trusted and change.later.trusted else _MARK
            mdc = "" if own.repeatability is None else f"{own.repeatability.mdc95:.3g}"
            table.add_row(
                own.quantity,
                change.first.date,
                change.later.date,
                f"{change.first.value:.4g}{mark}",
                f"{change.later.value:.4g}{mark}",
                f"{change.value:+.3g}{mark}",
                f"[{change.low:+.3g}, {change.high:+.3g}]{mark}",
                f"{change.percent:+.1f}{mark}",
                mdc,
                own.unit,
                "not to be trusted" if mark else _WORDS[change.clear],
            )
    return table


_METHOD = {
    "method1": "Method 1 (virtual sensor)",
    "method2": "Method 2 (physical sensor)",
    "diagnose": "the last model of diagnose",
}


def _caption(series: Sequence[Series]) -> str:
    repeats = series[0].repeatability
    if repeats is None:
        return (
            "No two sessions of one subject, side and posture are of one day: the intervals hold the noise "
            "within a session alone, and what mounting the arm anew does is unknown."
        )
    return (
        f"The intervals hold the scatter of repeats ({repeats.dof} degrees of freedom); MDC: minimal "
        "detectable change between two single sessions."
    )


def grouped(series: Sequence[Series]) -> list[list[Series]]:
    """Matrices of one subject, side, posture, load and method together."""
    groups: dict[tuple[str, str], list[Series]] = {}
    for own in series:
        if own.quantity[:1].lower() in _MATRICES or own.quantity == "I":
            groups.setdefault((own.title, own.method), []).append(own)
    return list(groups.values())


def comparison_sections(everything: Sequence[Findings]) -> list[Section]:
    """For a report of several studies: what changed between them, where they measured the same."""
    rows = [
        row for own in everything for row in rows_of(own.study, own.fit, own.diagnosis, trusted=own.trusted)
    ]
    groups = grouped(compare(rows))
    if not groups:
        return []
    return [
        Section(
            "Sessions side by side",
            "Change of inertia, damping and stiffness from the first day on. A change is believed where its "
            "interval holds what repeats of one day scatter.",
            tuple(of_terminal(comparison_table(group)) for group in groups),
            tuple(plot for group in groups for plot in over_time(group)),
        )
    ]


def comparison_json(series: Sequence[Series]) -> dict[str, Any]:
    """Format impid-compare/1: the series with their occasions, changes and repeatability."""
    return {
        "format": "impid-compare/1",
        "series": [
            {
                **{key: getattr(own, key) for key in _KEYS},
                "occasions": [asdict(one) for one in own.occasions],
                "changes": [
                    {
                        "from": change.first.date,
                        "to": change.later.date,
                        "value": change.value,
                        "ci95": [change.low, change.high],
                        "clear": change.clear,
                        "trusted": change.first.trusted and change.later.trusted,
                    }
                    for change in own.changes
                ],
                "repeatability": None if own.repeatability is None else asdict(own.repeatability),
            }
            for own in series
        ],
    }


_KEYS = ("subject", "side", "posture", "load", "method", "quantity", "unit")


def over_time(series: Sequence[Series]) -> list[Plot]:
    """Each quantity over the days, a bar for each session's 95 % interval by noise, and the days' means."""
    return [_over_time(own) for own in series]


def _over_time(own: Series) -> Plot:
    at = _places(own)
    x: list[float] = []
    y: list[float] = []
    for row in own.rows:
        place = at[row.date or f"study {row.study}"]
        half = 1.96 * row.sd
        x += [place, place, np.nan]
        y += [row.value - half, row.value + half, np.nan]
    days = np.array([at[one.date] for one in own.occasions])
    means = np.array([one.value for one in own.occasions])
    at_each = np.array([at[row.date or f"study {row.study}"] for row in own.rows])
    dated = all(row.date for row in own.rows)
    repeats = own.repeatability
    lines = [
        Line(days, means, "mean of each day", "second"),
        Line(np.array(x), np.array(y), "", "floor"),
        Line(
            at_each,
            np.array([row.value for row in own.rows]),
            "each session, 95 % by noise",
            "floor",
            dots=True,
        ),
    ]
    if repeats is not None:
        ends = np.array([days[0], days[-1]])
        for name, off in (
            ("minimal detectable change from the first day", repeats.mdc95),
            ("", -repeats.mdc95),
        ):
            lines.append(Line(ends, np.full(2, means[0] + off), name, "first"))
    name = "_".join(
        part for part in (own.subject, own.side, own.posture, own.load, own.method, own.quantity) if part
    )
    return Plot(
        key=f"sessions_{name}",
        title=f"{own.quantity} of {own.title}, {_METHOD[own.method]}",
        x_label="days since the first session" if dated else "session",
        y_label=f"{own.quantity} ({own.unit})",
        lines=tuple(lines),
    )


def _places(own: Series) -> dict[str, float]:
    """Days since the first; where a date is missing, the occasions' numbers."""
    dates = [one.date for one in own.occasions]
    if any(date.startswith("study ") for date in dates):
        return {date: float(number + 1) for number, date in enumerate(dates)}
    days = [datetime.date.fromisoformat(date).toordinal() for date in dates]
    return {date: float(day - days[0]) for date, day in zip(dates, days, strict=True)}
