"""impid-sim study"""

import time
from pathlib import Path

import click

from hil_sim.cli.options import ELF, FILE, FOLDER, SCENARIO, SEED, SENSOR
from hil_sim.scenarios.load import load
from hil_sim.scenarios.sensor import with_sensor
from hil_sim.study.write import write_study


@click.command("study")
@SCENARIO
@click.option("--out", type=FOLDER, required=True, help="Study folder to write; absent or empty.")
@SEED
@click.option(
    "--truth", "truth_file", type=FILE, help="Where to write what the scenario hides, outside the study."
)
@SENSOR
@ELF
def command(
    scenario: str, out: Path, seed: int, truth_file: Path | None, sensor: str | None, binary: Path | None
) -> None:
    """Write a study folder in virtual time, as fast as the machine can.

    \b
    Example:
      impid-sim study first-light --out study --seed 1 --truth truth.json
    """
    loaded = with_sensor(load(scenario), sensor)
    begin = time.perf_counter()
    write_study(loaded, out, seed, truth_file, binary)
    simulated = sum(trial.duration_s for trial in loaded.trials)
    took = time.perf_counter() - begin
    click.echo(f"{out}: {len(loaded.trials)} trials, {simulated:g} s in {took:.2f} s", err=True)
