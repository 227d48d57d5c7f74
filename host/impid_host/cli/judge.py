"""`impid-host judge`: a saved model's error on other records of the same machine."""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console

from impid_host.cli.checked import IMPOSSIBLE
from impid_host.cli.inputs import load_inputs
from impid_host.report.wide_console import table_console
from impid_host.study.model import Study

if TYPE_CHECKING:
    from impid_host.checks import Checks


@click.command()
@click.argument("model", type=click.Path(path_type=Path, dir_okay=False))
@click.argument("studies", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="STUDY...")
@click.option(
    "--json", "json_to", metavar="FILE|-", help="Also write the errors as JSON (- for standard output)."
)
@click.option(
    "--band",
    "bands",
    multiple=True,
    type=click.FloatRange(0.5, 200),
    metavar="HZ",
    help="Judge below this frequency; may be repeated. By default 4.5, 20, 50 Hz as far as the rate allows.",
)
@click.option(
    "--refit-record",
    is_flag=True,
    help="Fit what is the record's own (offsets, zeros, phases) anew in each study; else it is left out.",
)
def command(
    model: Path, studies: tuple[Path, ...], json_to: str | None, bands: tuple[float, ...], refit_record: bool
) -> None:
    """How well a saved model predicts other records of the same machine, whole.

    MODEL is what `diagnose --save-model` or `fit --save-model` wrote. Nothing is fitted on the STUDY
    folders; of the model's effects only those go along that belong to the machine. The textbook's model
    (inertia, gravity, viscous and dry friction, offset), fitted on the same data as MODEL, stands beside
    every number.

    \b
    Examples:
      impid-host judge model.json other_day/
      impid-host judge model.json slow/ fast/ --json judged.json
      impid-host judge model.json other_day/ --refit-record --band 4.5 --band 30
    """
    from impid_host.diagnosis.saved import read_model  # noqa: PLC0415  (slow to import)

    saved = read_model(model)
    read = [load_inputs([study], (), None) for study in studies]
    from impid_host.checks.of_model import gate_model  # noqa: PLC0415  (the catalogue is slow to import)
    from impid_host.diagnosis.other_records import BANDS_HZ, judge  # noqa: PLC0415
    from impid_host.report.check_tables import print_above, print_below, with_marks  # noqa: PLC0415
    from impid_host.report.judgement import band_table, judgement_json, lines, warnings  # noqa: PLC0415

    with Console(stderr=True).status("checking") as status:
        checks = _checks(read)
        status.update("judging")
        answer = judge(saved, read, bands or BANDS_HZ, refit_record=refit_record)
        checks = checks.with_more(gate_model(saved, read, answer.effects))
    for line in warnings(answer):
        click.echo(line, err=True)
    if json_to != "-":
        console = table_console()
        print_above(console, checks)
        for line in lines(answer):
            click.echo(line)
        for band in answer.bands:
            table = band_table(band, answer)
            console.print(table if checks.trusted else with_marks(table))
        print_below(console, checks)
    if json_to is not None:
        text = json.dumps(judgement_json(answer, checks), indent=2, allow_nan=False)
        if json_to == "-":
            click.echo(text)
        else:
            Path(json_to).write_text(text + "\n", encoding="utf-8")
    if checks.impossible:
        raise SystemExit(IMPOSSIBLE)


def _checks(studies: list[Study]) -> "Checks":
    """What each study's own data contradict; of several, each finding says in which."""
    from impid_host.checks import Checks, check_study  # noqa: PLC0415

    entries = []
    for study in studies:
        for entry in check_study(study):
            words = f"{study.name}: {entry.words}" if len(studies) > 1 else entry.words
            where = f"{study.name}: {entry.where}" if len(studies) > 1 else entry.where
            entries.append(replace(entry, words=words, where=where))
    return Checks.of(entries)
