"""The terminal's tables for the page, and two that only the page has."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from rich.table import Table

from impid_host.checks import Checks
from impid_host.diagnosis.result import Diagnosis
from impid_host.report.check_tables import with_marks
from impid_host.report.diagnosis_tables import effect_table, entries_of, parameter_table, stage_table
from impid_host.report.fit_parts import Besides, fit_parts
from impid_host.report.fit_tables import number
from impid_host.report.page.findings import Findings
from impid_host.robot.model import robot_model


@dataclass(frozen=True, slots=True)
class PageTable:
    """Cells as text; `right` says which columns hold numbers."""

    title: str
    heads: tuple[str, ...]
    right: tuple[bool, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


def of_terminal(table: Table) -> PageTable:
    """A table as the commands print it."""
    columns = [[_plain(cell) for cell in column.cells] for column in table.columns]
    return PageTable(
        title=_plain(table.title),
        heads=tuple(_plain(column.header) for column in table.columns),
        right=tuple(column.justify == "right" for column in table.columns),
        rows=tuple(zip_longest(*columns, fillvalue="")),
        note=_plain(table.caption),
    )


_UNIT = re.compile(r"[A-Za-z]+(?:[*/^][A-Za-z0-9]+)+")


def _plain(cell: object) -> str:
    """A cell of the terminal as people print it: kg·m² for kg*m^2, ± for +-."""
    text = "" if cell is None else str(cell).replace(" +- ", " ± ").replace("+- ", "± ")
    return text.replace("*", "·").replace("^2", "²") if _UNIT.fullmatch(text) else text


def result_table(diagnosis: Diagnosis, units: Mapping[str, str]) -> Table:
    """Robot and loads of the last stage; half widths, and what each is made of, where that was worked out.

    Args:
        units: of the robot's parameters, by name.
    """
    stage = diagnosis.stages[-1]
    causes = list(dict.fromkeys(c for own in stage.parts.values() for letter in own.values() for c in letter))
    table = Table(title="Result: the last model")
    for head in ("", "value", "± (95 %)", *(f"of it by\n{cause}" for cause in causes), "unit"):
        table.add_column(head, justify="left" if head in ("", "unit") else "right")
    # The arm before the robot: it is what was asked for.
    for entry in sorted(entries_of(stage), key=lambda each: each.load == ""):
        ci = np.array([entry.value - entry.half, entry.value + entry.half])
        parts = [entry.parts.get(cause) for cause in causes]
        table.add_row(
            entry.label,
            number(entry.value, ci),
            f"{entry.half:.2g}",
            *("" if part is None else f"{part:.2g}" for part in parts),
            entry.unit or units.get(entry.letter, ""),
        )
    table.caption = (
        "Half widths of 95 % intervals; parts add as squares. Noise is as coloured as it was found. "
        "Tolerances are those of [tolerance] in setup.toml."
        if causes
        else "Half widths of 95 % intervals: noise, as coloured as it was found, and nothing else."
    )
    return table


def diagnosis_tables(findings: Findings) -> list[PageTable]:
    """What `diagnose` prints, the result first."""
    answer = findings.diagnosis
    if answer is None:
        return []
    model = robot_model(findings.study.setup.robot)
    units = dict(zip(model.parameter_names, model.parameter_units, strict=True))
    tables = [result_table(answer, units), stage_table(answer)]
    if len(answer.stages) > 1:
        tables += [parameter_table(answer)]
    return [_marked(table, findings.checks) for table in tables]


def effects(findings: Findings) -> list[PageTable]:
    """What was found, with its evidence."""
    answer = findings.diagnosis
    if answer is None or len(answer.stages) < 2:
        return []
    return [_marked(effect_table(answer), findings.checks)]


def fit_tables(findings: Findings) -> list[PageTable]:
    """What `fit` prints, with what its intervals hold."""
    return [_marked(part, findings.fit_checks) for part in _of_fit(findings) if isinstance(part, Table)]


def fit_words(findings: Findings) -> tuple[str, ...]:
    """What `fit` says where it has no table."""
    return tuple(part for part in _of_fit(findings) if isinstance(part, str))


def _of_fit(findings: Findings) -> Iterator[Table | str]:
    if findings.fit is not None:
        besides = Besides(findings.pushes, findings.agreement)
        yield from fit_parts(findings.fit, besides, explained=True)


def _marked(table: Table, checks: Checks) -> PageTable:
    """Every number marked where the study is not to be trusted."""
    if checks.trusted:
        return of_terminal(table)
    marked = of_terminal(with_marks(table))
    return PageTable(
        marked.title,
        marked.heads,
        marked.right,
        marked.rows,
        f"(!) not to be trusted. {_plain(table.caption)}",
    )


def provenance_table(rows: Sequence[tuple[str, str]]) -> PageTable:
    """Two columns, what and which."""
    return PageTable("Where these numbers come from", ("", ""), (False, False), tuple(rows))
