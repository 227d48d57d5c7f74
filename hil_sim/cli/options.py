"""Options that several subcommands share."""

from pathlib import Path

import click

SCENARIO = click.argument("scenario")
SEED = click.option(
    "--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Seed of all chance."
)
TRIAL = click.option("--trial", metavar="NAME", help="A trial of the scenario.")
FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)
SENSOR = click.option(
    "--sensor",
    type=click.Choice(["adxl203", "adxl355"]),
    help="Another accelerometer than the scenario's, as its data sheet has it.",
)
ELF = click.option(
    "--elf",
    "binary",
    type=FILE,
    help="Run this binary of the firmware in the emulator instead of the native core.",
)
