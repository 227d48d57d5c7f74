"""`impid-host fit`: the robot, then the load or arm, of a study."""

import json
from pathlib import Path
from typing import Literal

import click
from rich.console import Console

from impid_host.cli.inputs import load_inputs
from impid_host.impedance.campaign import Options, StudyFit, fit_study
from impid_host.impedance.identify import RobotFit
from impid_host.impedance.rows import Split
from impid_host.report.fit_json import fit_json
from impid_host.report.fit_tables import load_table, robot_table
from impid_host.robot.terms import TERMS
from impid_host.signals.chain import CHAINS


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
    "--chain",
    type=click.Choice(list(CHAINS)),
    default="default",
    show_default=True,
    help="Signal chain: ours, as published by Dyck and Tavakoli, or as the EMPS benchmark's authors did it.",
)
@click.option(
    "--acceleration",
    type=click.Choice(["accelerometer", "angles"]),
    help="Where accelerations come from; by default the accelerometer where there is one.",
)
@click.option("--cutoff", type=click.FloatRange(0.5, 200), metavar="HZ", help="Cut-off of the default chain.")
@click.option(
    "--with",
    "terms",
    multiple=True,
    type=click.Choice(list(TERMS)),
    metavar="EFFECT",
    help=f"Add a term to the robot model; may be repeated. One of {', '.join(TERMS)}.",
)
@click.option(
    "--validate",
    type=click.FloatRange(0),
    default=10.0,
    show_default=True,
    metavar="SECONDS",
    help="Hold out the end of each trial for validation (at most a fifth); 0 fits everything.",
)
@click.option(
    "--json", "json_to", metavar="FILE|-", help="Also write the result as JSON (- for standard output)."
)
@click.option(
    "--figures", type=click.Path(path_type=Path, file_okay=False), help="Write figures (PNG) to this folder."
)
def command(  # noqa: PLR0917  (click hands over every option by name)
    paths: tuple[Path, ...],
    robot_log: tuple[Path, ...],
    setup: Path | None,
    chain: str,
    acceleration: Literal["accelerometer", "angles"] | None,
    cutoff: float | None,
    terms: tuple[str, ...],
    validate: float,
    json_to: str | None,
    figures: Path | None,
) -> None:
    """Identify the robot, then the load or arm, with 95 % intervals.

    The robot's parameters come from the free trials (or from [prior] in setup.toml when there are none);
    then every load, all its trials together, by Method 1 (virtual force sensor) and, where the log has
    forces, Method 2 (physical sensor).

    \b
    Examples:
      impid-host fit study/
      impid-host fit study/ --json result.json --figures figures/
      impid-host fit emps/ --chain emps --with friction.coulomb --with actuator.offset --validate 0
    """
    study = load_inputs(paths, robot_log, setup)
    row = CHAINS[chain] if cutoff is None else CHAINS[chain].with_cutoff(cutoff)
    options = Options(row, acceleration, terms, Split(validate))
    errors = Console(stderr=True)
    with errors.status("reading") as status:
        result = fit_study(study, options, status.update)
        if figures is not None:
            status.update("drawing")
            from impid_host.report.fit_figures import draw_study  # noqa: PLC0415  (matplotlib is slow to import)

            drawn = draw_study(result, figures)
    if json_to != "-":
        _print(result)
        if figures is not None:
            click.echo(f"{len(drawn)} figures in {figures}")
    if json_to is not None:
        text = json.dumps(
            fit_json(result.study, result.chain, result.trials, result.robot, result.loads), indent=2
        )
        if json_to == "-":
            click.echo(text)
        else:
            Path(json_to).write_text(text + "\n", encoding="utf-8")


def _print(result: StudyFit) -> None:
    console = Console()
    if isinstance(result.robot, RobotFit):
        console.print(robot_table(result.robot))
    else:
        console.print(
            "Robot parameters from \\[prior] in setup.toml; their uncertainty is unknown and not propagated."
        )
    for load in dict.fromkeys(fit.load for fit in result.loads):
        console.print(load_table([fit for fit in result.loads if fit.load == load]))
