"""`impid-host compare`: did M, B or K change from session to session?"""

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console

from impid_host.cli.report import write_text
from impid_host.errors import InputError, UndeterminedError

if TYPE_CHECKING:
    from impid_host.sessions.row import Row

_MOST_NAMED = 10


@click.command()
@click.argument("studies", nargs=-1, required=True, metavar="STUDY|RESULTS...")
@click.option(
    "--table",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Also write every number of every study as one long table, .csv or .parquet.",
)
@click.option(
    "--json", "json_to", metavar="FILE|-", help="Also write the changes as JSON (- for standard output)."
)
@click.option(
    "--figures",
    type=click.Path(path_type=Path, file_okay=False),
    help="Write each quantity over time as PDF and SVG to this folder.",
)
@click.option(
    "--steady", is_flag=True, help="Nothing changed from day to day: all sessions are repeats (test-retest)."
)
@click.option(
    "--diagnose",
    "diagnosed",
    is_flag=True,
    help="Also compare the last models of `diagnose`; takes a minute or so for each study.",
)
def command(
    studies: tuple[str, ...],
    table: Path | None,
    json_to: str | None,
    figures: Path | None,
    steady: bool,
    diagnosed: bool,
) -> None:
    """Put sessions beside each other: change of M, B and K, with intervals, and minimal detectable change.

    Subject, side, date and posture stand in [session] of setup.toml or in a trial.toml. Sessions of one
    subject, side and posture on one day are repeats: their scatter goes into every interval. Without repeats
    the intervals hold the noise within a session alone, and that is said. One STUDY is enough for --table.
    RESULTS of `impid-host batch`, a folder or an address, are read as they are: nothing is fitted again.

    \b
    Examples:
      impid-host compare before/ after/
      impid-host compare p07_*/ --table all.csv --figures figures/
      impid-host compare test/ retest/ --steady --json -
      impid-host compare results/ --figures figures/
    """
    from impid_host.batch.read_back import is_data_set, read_results  # noqa: PLC0415  (slow to import)
    from impid_host.cli.checked import IMPOSSIBLE  # noqa: PLC0415
    from impid_host.cli.inputs import load_studies  # noqa: PLC0415

    results = [read_results(path) for path in studies if is_data_set(path)]
    folders = [Path(path) for path in studies if not is_data_set(path)]
    _once([*(place for own in results for place in own.places), *(str(path.resolve()) for path in folders)])
    read = load_studies(folders)
    from impid_host.report.page.findings import gather  # noqa: PLC0415  (the catalogue is slow to import)
    from impid_host.report.wide_console import table_console  # noqa: PLC0415
    from impid_host.sessions.change import compare  # noqa: PLC0415
    from impid_host.sessions.long_table import rows_of, write_table  # noqa: PLC0415
    from impid_host.sessions.shown import (  # noqa: PLC0415
        comparison_json,
        comparison_table,
        grouped,
        over_time,
    )

    rows = [row for own in results for row in own.rows]
    impossible = any(own.impossible for own in results)
    with Console(stderr=True).status("checking") as status:
        for study in read:
            own = gather(study, status.update, diagnosed=diagnosed)
            impossible |= own.checks.impossible
            if not own.trusted:
                click.echo(f"{study.name}: {own.verdict}", err=True)
            rows += rows_of(study, own.fit, own.diagnosis, trusted=own.trusted)
    if table is not None:
        write_table(rows, table)
        click.echo(f"{table}: {len(rows)} rows", err=json_to == "-")
    series = compare(rows, steady=steady)
    if not series and (table is None or len({row.study for row in rows}) != 1):
        raise UndeterminedError(_nothing_common(rows))
    if json_to != "-":
        console = table_console()
        for group in grouped(series):
            console.print(comparison_table(group))
    if figures is not None and series:
        from impid_host.report.page.journal import draw  # noqa: PLC0415  (matplotlib is slow to import)

        drawn = draw([plot for group in grouped(series) for plot in over_time(group)], figures)
        click.echo(f"{len(drawn)} figures in {figures}", err=True)
    if json_to is not None:
        text = json.dumps(comparison_json(series), indent=2, allow_nan=False)
        if json_to == "-":
            click.echo(text)
        else:
            write_text(Path(json_to), text + "\n")
    if impossible:
        raise SystemExit(IMPOSSIBLE)


def _once(places: list[str]) -> None:
    """A study that counted twice would be a repeat without scatter.

    Raises:
        InputError: one does.
    """
    twice = next((place for place, times in Counter(places).items() if times > 1), None)
    if twice is not None:
        raise InputError(twice, "is given twice", "give each study once, by itself or in results")


def _nothing_common(rows: "Sequence[Row]") -> str:
    """Why there is nothing to compare."""

    def words(row: "Row") -> str:
        return ", ".join(part for part in (row.subject, row.side, row.posture, row.load) if part)

    seen = list(dict.fromkeys(f"{row.study} ({words(row)})" for row in rows if row.load))
    more = "; ..." if len(seen) > _MOST_NAMED else ""
    return (
        "no two studies measured one load of one subject, side and posture: "
        f"{'; '.join(seen[:_MOST_NAMED]) or 'no load at all'}{more}; name loads alike (`load` in trial.toml)"
    )
