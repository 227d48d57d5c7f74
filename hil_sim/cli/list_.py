"""impid-sim list"""

import click

from hil_sim.scenarios.load import load, names


@click.command("list")
def command() -> None:
    """Show the scenarios that ship with the simulator, and their trials.

    \b
    Example:
      impid-sim list
    """
    for name in names():
        scenario = load(name)
        click.echo(f"{name}: {scenario.title}")
        for trial in scenario.trials:
            click.echo(f"  {trial.name:24} {trial.kind:12} {trial.duration_s:g} s")
