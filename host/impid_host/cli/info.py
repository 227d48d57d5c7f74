"""`impid-host info`: what a recording holds."""

import json
from pathlib import Path

import click

from impid_host.recording.overview import lines, overview
from impid_host.recording.reader import survey


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE.mcap...")
@click.option("--json", "as_json", is_flag=True, help="For programs: one JSON object per file and line.")
def command(files: tuple[Path, ...], *, as_json: bool) -> None:
    """Tell what a recording holds: what, when, how much, losses, clock, health of the board.

    A file that was cut off is read as far as it goes; what is missing is said.

    \b
    Examples:
      impid-host info free_01.mcap
      impid-host info --json *.mcap
    """
    for file in files:
        recording = survey(file)
        if as_json:
            click.echo(json.dumps(overview(recording)))
        else:
            click.echo("\n".join(lines(recording)))
