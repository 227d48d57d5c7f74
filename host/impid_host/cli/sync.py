"""`impid-host sync`: offset and drift between the board's clock and the robot's log."""

import json
from pathlib import Path

import click

from impid_host.cli.inputs import load_inputs
from impid_host.errors import UndeterminedError


@click.command()
@click.argument(
    "paths", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="STUDY|RECORDING..."
)
@click.option(
    "--robot-log",
    multiple=True,
    type=click.Path(path_type=Path),
    help="Robot log (CSV) of each recording, in order.",
)
@click.option("--setup", type=click.Path(path_type=Path), help="setup.toml that goes with recordings.")
@click.option(
    "--json", "json_to", metavar="FILE|-", help="Also write the result as JSON (- for standard output)."
)
def command(
    paths: tuple[Path, ...], robot_log: tuple[Path, ...], setup: Path | None, json_to: str | None
) -> None:
    """Offset and drift of the board's clock against the robot's, trial by trial.

    Both log the same joint angles; matching the two angle signals gives the offset to a fraction of a
    microsecond. A motion that leaves the clocks open is refused.

    \b
    Examples:
      impid-host sync study/
      impid-host sync free_01.mcap --robot-log free_01.csv --setup setup.toml --json -
    """
    study = load_inputs(paths, robot_log, setup)
    from impid_host.report.fit_tables import clock_table  # noqa: PLC0415  (slow to import)
    from impid_host.report.wide_console import table_console  # noqa: PLC0415
    from impid_host.signals.align import match_trial  # noqa: PLC0415

    trials = [trial for trial in study.trials if trial.device is not None]
    if not trials:
        raise UndeterminedError(
            f"{study.name}: no trial has a device.csv, so there is no second clock to match"
        )
    fits = [(trial.name, match_trial(trial, study.setup)) for trial in trials]
    if json_to != "-":
        table_console().print(clock_table(fits))
    if json_to is not None:
        from impid_host.report.fit_json import clock_json  # noqa: PLC0415

        document = {
            "format": "impid-sync/1",
            "study": study.name,
            "trials": [{"name": name} | clock_json(fit) for name, fit in fits],
        }
        text = json.dumps(document, indent=2)
        if json_to == "-":
            click.echo(text)
        else:
            Path(json_to).write_text(text + "\n", encoding="utf-8")
