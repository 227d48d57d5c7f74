"""`impid-host batch`: any number of studies into one Parquet data set."""

import os
import shlex
import sys
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from impid_host.robot.terms import TERMS

if TYPE_CHECKING:
    from impid_host.batch.run import Outcome
    from impid_host.batch.task import Answer

_MOST_LINES = 20


@click.command()
@click.argument("studies", nargs=-1, required=True, metavar="STUDY...")
@click.option("--out", required=True, metavar="FOLDER", help="Where the results go; a path or an address.")
@click.option(
    "--diagnose",
    is_flag=True,
    help="Also look for what the first model lacks; a minute or so for each study.",
)
@click.option(
    "--with", "terms", multiple=True, type=click.Choice(list(TERMS)), help="Optional term of the robot model."
)
@click.option(
    "--jobs",
    type=click.IntRange(1),
    metavar="N",
    help="Processes on this machine; by default one for each core.",
)
@click.option("--scheduler", metavar="ADDRESS", help="Work on a Dask cluster, tcp://host:8786 say.")
@click.option(
    "--timeout",
    type=click.FloatRange(1),
    default=1800,
    show_default=True,
    metavar="SECONDS",
    help="What takes longer is ended and reported.",
)
def command(
    studies: tuple[str, ...],
    out: str,
    diagnose: bool,
    terms: tuple[str, ...],
    jobs: int | None,
    scheduler: str | None,
    timeout: float,
) -> None:
    """Check and fit any number of studies; results as a Parquet data set, a row for each number.

    A STUDY is a study folder, or a folder with studies anywhere below it, here or at an address
    (s3://bucket/archive, sftp://host/archive). What is done already, by the hash of data, options and
    version, is skipped: after an interruption the same command goes on. A study that is broken, crashes or
    takes too long is reported and harms no other. Exit status 1 where one is broken, 3 where something is
    impossible.

    \b
    Examples:
      impid-host batch archive/ --out results/
      impid-host batch p07_*/ --out results/ --diagnose --jobs 8
      impid-host batch s3://clinic/archive --out s3://clinic/results --scheduler tcp://10.0.0.1:8786
      impid-host compare results/
    """
    from impid_host.batch.run import run  # noqa: PLC0415  (slow to import)
    from impid_host.batch.task import BatchOptions  # noqa: PLC0415
    from impid_host.cli.checked import IMPOSSIBLE  # noqa: PLC0415

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("looking for studies", total=None)

        def progress(done: int, total: int, broken: int) -> None:
            words = "studies" if not broken else f"studies ({broken} broken)"
            bar.update(task, description=words, completed=done, total=total)

        try:
            outcome = run(
                studies,
                out,
                BatchOptions(diagnose, tuple(sorted(set(terms)))),
                jobs=jobs or os.cpu_count() or 1,
                scheduler=scheduler,
                timeout_s=timeout,
                command=shlex.join(["impid-host", *sys.argv[1:]]),
                progress=progress,
            )
        except KeyboardInterrupt:
            click.echo(f"interrupted; what was finished is in {out}, and the same command goes on", err=True)
            raise SystemExit(130) from None
    _tell(outcome, out)
    if outcome.broken:
        raise SystemExit(1)
    if outcome.impossible:
        raise SystemExit(IMPOSSIBLE)


def _tell(outcome: "Outcome", out: str) -> None:
    counts = ", ".join(f"{number} {status}" for status, number in sorted(outcome.counts.items()))
    old = f"; {outcome.superseded} older results replaced" if outcome.superseded else ""
    click.echo(f"{out}: {counts}{old}")
    _list(outcome.broken)
    _list(outcome.undetermined)
    for own in outcome.impossible[:_MOST_LINES]:
        click.echo(f"{own.place}: {own.verdict}", err=True)


def _list(answers: "tuple[Answer, ...]") -> None:
    for own in answers[:_MOST_LINES]:
        remedy = f"; {own.remedy}" if own.remedy else ""
        click.echo(f"{own.place}: {own.status}: {own.why}{remedy}", err=True)
    if len(answers) > _MOST_LINES:
        click.echo(
            f"and {len(answers) - _MOST_LINES} more; their rows in the results have status and why", err=True
        )
