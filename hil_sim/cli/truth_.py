"""impid-sim truth"""

import json

import click

from hil_sim.cli.options import SCENARIO, SEED, TRIAL
from hil_sim.scenarios.load import load
from hil_sim.scenarios.load import trial as find_trial
from hil_sim.truth import scenario_json


@click.command("truth")
@SCENARIO
@SEED
@TRIAL
def command(scenario: str, seed: int, trial: str | None) -> None:
    """Print what a scenario hides, as JSON: for whoever checks a result.

    The clocks' offset of a trial is decided when it runs; `serve --truth` and `study --truth` write it.

    \b
    Example:
      impid-sim truth first-light --trial free_01
    """
    loaded = load(scenario)
    trials = loaded.trials if trial is None else (find_trial(loaded, trial),)
    click.echo(json.dumps(scenario_json(loaded, seed, {}, trials), indent=2))
