"""`impid-host import`: foreign logs into a study folder."""

from pathlib import Path

import click

from impid_host.cli.checked import offer_check
from impid_host.study.folder import write_study
from impid_host.study.importing import import_logs
from impid_host.study.notices import notices_as_lines

_PATH = click.Path(path_type=Path)


@click.command("import")
@click.argument("logs", metavar="LOG...", type=_PATH, nargs=-1, required=True)
@click.option("--mapping", required=True, type=_PATH, metavar="MAP.toml", help="Columns, units, trials.")
@click.option("--out", required=True, type=_PATH, metavar="STUDY/", help="Study folder to make.")
def command(logs: tuple[Path, ...], mapping: Path, out: Path) -> None:
    """Turn foreign logs (CSV, Parquet, MATLAB .mat, ROS bags, XDF, MDF, C3D) into a study folder.

    The mapping is a small TOML file: the apparatus, where each column of the robot's log comes from (name,
    unit, scale, or an expression such as a drive's gain), and one table for each trial.
    docs/import.md explains it, and docs/mappings/ holds mappings of published data sets.

    \b
    Example:
      impid-host import DATA_EMPS.mat --mapping docs/mappings/emps_mat.toml --out emps/
    """
    with notices_as_lines(lambda line: click.echo(line, err=True)):
        study = import_logs(logs, mapping, out.resolve().name)
        write_study(study, out)
    for trial in study.trials:
        duration = trial.robot.t[-1] - trial.robot.t[0]
        forces = "" if trial.robot.force is None else ", measured forces"
        click.echo(f"{trial.name}: {trial.kind}, {len(trial.robot)} rows, {duration:.3f} s{forces}")
    click.echo(f"{len(study.trials)} trials written to {out}")
    offer_check(out)
