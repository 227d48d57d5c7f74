"""What is printed of checks: the sentences above every table, marks on numbers, the table of agreement."""

from collections.abc import Iterator, Sequence
from itertools import zip_longest

from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from impid_host.checks import Agreement, Check, Checks

MARK = " (!)"
_STYLE = {"impossible": "bold red", "contradiction": "bold yellow", "suspect": "dim"}
_HEAD = {
    "impossible": "IMPOSSIBLE: these numbers are of no robot, arm or spring",
    "contradiction": "CONTRADICTION: two measurements of one thing disagree",
    "suspect": "Worth a look",
}


def print_above(console: Console, checks: Checks) -> None:
    """What stands above the tables: impossible and contradicting findings."""
    for line in _lines(checks, ("impossible", "contradiction")):
        console.print(line)


def print_below(console: Console, checks: Checks) -> None:
    """What stands below them: the rest."""
    for line in _lines(checks, ("suspect",)):
        console.print(line)


def _lines(checks: Checks, verdicts: Sequence[str]) -> Iterator[Text]:
    for verdict in verdicts:
        entries = [entry for entry in checks if entry.verdict == verdict]
        if entries:
            yield Text(_HEAD[verdict], style=_STYLE[verdict])
            for entry in entries:
                yield from check_lines(entry)
            yield Text("")


def check_lines(entry: Check) -> Iterator[Text]:
    """One finding: its name and sentence, and what to do."""
    yield Text(f"  {entry.label}: {entry.words}", style=_STYLE[entry.verdict])
    if entry.remedy:
        yield Text(f"    -> {entry.remedy}")


def with_marks(table: Table) -> Table:
    """The same table with every number marked, so that none is copied without its warning."""
    copy = Table(
        title=table.title,
        title_justify=table.title_justify,
        caption=f"{MARK.strip()} {table.caption}" if table.caption else None,
        caption_justify=table.caption_justify,
        style="red",
    )
    columns: list[list[RenderableType]] = []
    for column in table.columns:
        copy.add_column(column.header, justify=column.justify, overflow=column.overflow)
        numbers = column.justify == "right"
        columns.append([_with_mark(cell) if numbers else cell for cell in column.cells])
    for row in zip_longest(*columns, fillvalue=""):
        copy.add_row(*row)
    return copy


def _with_mark(cell: RenderableType) -> RenderableType:
    return f"{cell}{MARK}" if isinstance(cell, str) and any(c.isdigit() for c in cell) else cell


def agreement_table(found: Agreement) -> Table:
    """What was measured twice."""
    table = Table(title="Measured twice", title_justify="left")
    for heading, right in (
        ("by", False),
        ("of", False),
        ("quantity", False),
        ("first", True),
        ("second", True),
        ("unit", False),
        ("apart\n(std. errors)", True),
    ):
        table.add_column(heading, justify="right" if right else "left", overflow="fold")
    for pair in found.pairs:
        table.add_row(
            pair.what,
            pair.where,
            pair.quantity,
            f"{pair.first:.5g}",
            f"{pair.second:.5g}",
            pair.unit,
            f"{pair.apart:.1f}",
        )
    return table
