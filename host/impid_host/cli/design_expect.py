"""`impid-host design expect`: what more trials like those at hand would give."""

import json
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

from impid_host.cli.inputs import load_inputs
from impid_host.design.expected import MOST_TRIALS, Expected, expected_of_study
from impid_host.impedance.campaign import Options, default_chain, fit_study
from impid_host.impedance.rows import Split
from impid_host.report.wide_console import table_console


@click.command("expect")
@click.argument("study", type=click.Path(path_type=Path))
@click.option(
    "--trials",
    type=click.IntRange(1, 1000),
    default=6,
    show_default=True,
    help="How many trials of each load there would be in all.",
)
@click.option(
    "--within",
    type=click.FloatRange(0, 100, min_open=True),
    default=5.0,
    show_default=True,
    metavar="PERCENT",
    help="Say how many trials give each parameter to so many per cent (half of its 95 % interval).",
)
@click.option("--json", "json_to", metavar="FILE|-", help="Also write as JSON (- for standard output).")
def expect(study: Path, trials: int, within: float, json_to: str | None) -> None:
    """The 95 % intervals that more trials like those at hand would give, before they are run.

    One trial of each load is enough to ask. What the robot's own parameters leave open (Method 1) does not
    shrink with more load trials; where it is the limit, no number of them is enough: record more free trials.

    \b
    Examples:
      impid-host design expect pilot/
      impid-host design expect pilot/ --trials 12 --within 4
    """
    read = load_inputs([study], (), None)
    chain, split = default_chain(read), Split(0.0)
    with Console(stderr=True).status("fitting"):
        fitted = fit_study(read, Options(chain=chain, split=split))
        found = expected_of_study(read, fitted, chain, split)
    if json_to != "-":
        console = table_console()
        for own in found:
            console.print(_table(own, trials, within))
    if json_to is not None:
        text = json.dumps(
            {"format": "impid-expect/1", "loads": [_json(own, trials, within) for own in found]}
        )
        if json_to == "-":
            click.echo(text)
        else:
            Path(json_to).write_text(text + "\n", encoding="utf-8")


def _table(own: Expected, trials: int, within: float) -> Table:
    table = Table(
        title=f"Load {own.load}, {own.method}: {own.trials} trial(s) now, {trials} then", title_justify="left"
    )
    for heading in ("parameter", "value", "now +-", f"with {trials} +-", f"trials for {within:g} %", "unit"):
        table.add_column(heading, justify="left" if heading in ("parameter", "unit") else "right")
    now, then, enough = own.with_trials(own.trials), own.with_trials(trials), own.enough(within)
    for k, name in enumerate(own.names):
        size = abs(float(own.value[k]))
        cells = [f"{half:.2g} ({100 * half / size:.1f} %)" for half in (float(now[k]), float(then[k]))]
        count = f"more than {MOST_TRIALS}" if enough[k] is None else str(enough[k])
        table.add_row(name, f"{own.value[k]:.4g}", *cells, count, own.units[k])
    return table


def _json(own: Expected, trials: int, within: float) -> dict[str, object]:
    now, then, enough = own.with_trials(own.trials), own.with_trials(trials), own.enough(within)
    return {
        "load": own.load,
        "method": own.method,
        "trials_now": own.trials,
        "trials_then": trials,
        "within_percent": within,
        "parameters": {
            name: {
                "value": float(own.value[k]),
                "unit": own.units[k],
                "half_width_now": float(now[k]),
                "half_width_then": float(then[k]),
                "trials_enough": enough[k],
            }
            for k, name in enumerate(own.names)
        },
    }
