"""impid-sim list"""

from collections import Counter

import click

from hil_sim.scenarios.load import load, names
from hil_sim.scenarios.schema import Scenario


@click.command("list")
@click.argument("scenario", required=False)
def command(scenario: str | None) -> None:
    """Show the scenarios that ship with the simulator, or the trials of one SCENARIO.

    \b
    Example:
      impid-sim list
      impid-sim list first-light
    """
    if scenario is not None:
        for trial in load(scenario).trials:
            click.echo(f"{trial.name:24} {trial.kind:12} {trial.duration_s:g} s")
        return
    for name in names():
        loaded = load(name)
        click.echo(f"{name:20} {_trials(loaded):34} {loaded.title}")


def _trials(scenario: Scenario) -> str:
    kinds = Counter(trial.kind for trial in scenario.trials)
    return ", ".join(f"{count} {kind}" for kind, count in kinds.items())
