"""`impid-host compare`: did M, B or K change from session to session?"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console

from impid_host.cli.report import write_text
from impid_host.errors import UndeterminedError

if TYPE_CHECKING:
    from impid_host.sessions.long_table import Row


@click.command()
@click.argument("studies", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="STUDY...")
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
    studies: tuple[Path, ...],
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

    \b
    Examples:
      impid-host compare before/ after/
      impid-host compare p07_*/ --table all.csv --figures figures/
      impid-host compare test/ retest/ --steady --json -
    """
    from impid_host.cli.checked import IMPOSSIBLE  # noqa: PLC0415  (what follows is slow to import)
    from impid_host.cli.inputs import load_studies  # noqa: PLC0415

    read = load_studies(studies)
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

    rows, impossible = [], False
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
    if not series and (table is None or len(studies) > 1):
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


def _nothing_common(rows: "Sequence[Row]") -> str:
    """Why there is nothing to compare."""
    seen = dict.fromkeys(
        f"{row.study} ({', '.join(part for part in (row.subject, row.side, row.posture, row.load) if part)})"
        for row in rows
        if row.load
    )
    return (
        "no two studies measured one load of one subject, side and posture: "
        f"{'; '.join(seen) or 'no load at all'}; name loads alike (`load` in trial.toml)"
    )
