"""impid-sim random"""

import json
from pathlib import Path

import click

from hil_sim.cli.options import FILE, FOLDER, SEED
from hil_sim.scenarios.random import FULL, NOISES, SMALL, random_scenario
from hil_sim.study.write import write_study


@click.command("random")
@SEED
@click.option("--effect", "effects", multiple=True, metavar="LABEL", help="Hide this; may be repeated.")
@click.option(
    "--strength",
    type=click.FloatRange(min=0.0, min_open=True),
    default=5.0,
    show_default=True,
    help="Visible part of each effect over the noise floor, in the residual where it is clearest.",
)
@click.option(
    "--noise",
    type=click.Choice(NOISES),
    default=NOISES[0],
    show_default=True,
    help="Of the logged torque: white and a little autoregressive, or one kind alone.",
)
@click.option(
    "--force-sensor/--no-force-sensor", default=True, show_default=True, help="Whether the robot has one."
)
@click.option(
    "--counts-per-rev",
    type=click.IntRange(min=1000),
    default=400_000,
    show_default=True,
    help="Of the encoders.",
)
@click.option("--weighed/--not-weighed", default=False, show_default=True, help="Whether payloads were.")
@click.option(
    "--torque-step",
    "torque_quantum_Nm",
    type=click.FloatRange(min=0.0),
    default=0.002,
    show_default=True,
    help="The logged torque comes in steps of this, N m.",
)
@click.option("--out", type=FOLDER, required=True, help="Study folder to write; absent or empty.")
@click.option("--truth", "truth_file", type=FILE, help="Where to write what is hidden, outside the study.")
@click.option("--small", is_flag=True, help="Two free and two loaded trials of 30 s.")
def command(
    seed: int,
    effects: tuple[str, ...],
    strength: float,
    noise: str,
    force_sensor: bool,
    counts_per_rev: int,
    weighed: bool,
    torque_quantum_Nm: float,
    out: Path,
    truth_file: Path | None,
    small: bool,
) -> None:
    """Write the study of a random laboratory, in good order but for what is asked for.

    A label is NAME@WHERE; `:free`, `:load` or `:TRIAL+TRIAL` behind it says when, `,PARAMETER=NUMBER` fixes
    what chance would decide.

    \b
    Examples:
      impid-sim random --seed 7 --out study --small
      impid-sim random --seed 7 --effect friction.coulomb@joint1 --strength 3 --out study --truth truth.json
      impid-sim random --seed 7 --effect elastic.cartesian@tip:load --effect force.scale,gain=1.05 --out study
    """
    size = SMALL if small else FULL
    scenario, reached = random_scenario(
        seed,
        size,
        effects,
        strength,
        noise=noise,
        force_sensor=force_sensor,
        counts_per_rev=counts_per_rev,
        weighed=weighed,
        torque_quantum_Nm=torque_quantum_Nm,
    )
    write_study(scenario, out, seed, truth_file)
    if truth_file is not None:
        truth = json.loads(truth_file.read_text(encoding="utf-8"))
        truth["strength"] = {"wanted": strength, "reached": reached}
        truth_file.write_text(json.dumps(truth, indent=2) + "\n", encoding="utf-8")
