"""`impid-host diagnose`: what the papers' model lacks in a study, and how much better it is with it."""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from impid_host.cli.checked import IMPOSSIBLE, refused
from impid_host.cli.inputs import load_inputs
from impid_host.errors import UndeterminedError
from impid_host.report.wide_console import table_console

if TYPE_CHECKING:
    from impid_host.diagnosis.result import Diagnosis


@click.command()
@click.argument("study", type=click.Path(path_type=Path))
@click.option(
    "--cutoff",
    type=click.FloatRange(0.5, 200),
    metavar="HZ",
    help="Tell errors below this frequency; by default, as `fit` does, twice the band of the motion, 4.5 Hz "
    "at least.",
)
@click.option(
    "--json", "json_to", metavar="FILE|-", help="Also write the answer as JSON (- for standard output)."
)
@click.option(
    "--figures", type=click.Path(path_type=Path, file_okay=False), help="Write figures (PNG) to this folder."
)
@click.option(
    "--save-model",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write robot, loads and effects found, with the hashes of the data.",
)
def command(
    study: Path, cutoff: float | None, json_to: str | None, figures: Path | None, save_model: Path | None
) -> None:
    """Find the cause of what the papers' model leaves unexplained, and prove it on held-out data.

    Effects of a fixed catalogue (friction, springs, delays, sensor faults, what a load does beyond mass and
    springs) are tried one after another. Each one that is added is judged on data that took no part in
    choosing or fitting it. Structure without a known cause is reported as such, never under the nearest name.

    \b
    Examples:
      impid-host diagnose study/
      impid-host diagnose study/ --json diagnosis.json
      impid-host diagnose study/ --figures figures/ --save-model model.json
    """
    read = load_inputs([study], (), None)
    from impid_host.checks import check_study  # noqa: PLC0415
    from impid_host.checks.of_diagnosis import beside_diagnosis  # noqa: PLC0415  (a second in all)
    from impid_host.diagnosis.diagnose import diagnose  # noqa: PLC0415
    from impid_host.diagnosis.verdict import beside_checks  # noqa: PLC0415
    from impid_host.report.check_tables import print_above, print_below  # noqa: PLC0415

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("checking", total=1.0)
        checks = check_study(read)
        try:
            answer = diagnose(
                read,
                lambda words, share: bar.update(task, description=words, completed=share),
                cutoff_hz=cutoff,
            )
        except UndeterminedError as error:
            refused(read, checks, error, json_to)
    checks = beside_diagnosis(read, answer, checks)
    answer = replace(answer, verdict=beside_checks(answer.verdict, checks))
    if json_to != "-":
        print_above(table_console(), checks)
        show(answer, trusted=checks.trusted)
        print_below(table_console(), checks)
    if figures is not None:
        from impid_host.report.diagnosis_figures import draw_diagnosis  # noqa: PLC0415  (matplotlib is slow)

        drawn = draw_diagnosis(answer, figures)
        click.echo(f"{len(drawn)} figure{'s' if len(drawn) > 1 else ''} in {figures}", err=True)
    if save_model is not None:
        from impid_host.diagnosis.saved import save_model as write_model  # noqa: PLC0415

        write_model(answer, read, save_model)
    if json_to is not None:
        from impid_host.report.diagnosis_json import diagnosis_json  # noqa: PLC0415
        from impid_host.report.sessions_json import sessions_json  # noqa: PLC0415

        text = json.dumps(diagnosis_json(answer, checks) | sessions_json(read), indent=2, allow_nan=False)
        if json_to == "-":
            click.echo(text)
        else:
            Path(json_to).write_text(text + "\n", encoding="utf-8")
    if checks.impossible:
        raise SystemExit(IMPOSSIBLE)


def show(answer: "Diagnosis", *, trusted: bool = True) -> None:
    """Print the answer for people; where it is not trusted every number is marked, and nothing is said to be
    complete.
    """
    from impid_host.report.check_tables import with_marks  # noqa: PLC0415
    from impid_host.report.diagnosis_tables import (  # noqa: PLC0415  (the catalogue is slow to import)
        effect_table,
        parameter_table,
        stage_table,
    )
    from impid_host.report.diagnosis_units import structure_words  # noqa: PLC0415

    console = table_console()
    console.print(answer.verdict[:1].upper() + answer.verdict[1:] + ".")

    def put(table: Table) -> None:
        console.print(table if trusted else with_marks(table))

    put(stage_table(answer))
    if len(answer.stages) > 1:
        put(effect_table(answer))
        put(parameter_table(answer))
    for row in answer.structure:
        console.print(f"No known effect explains this: {structure_words(row, answer)}")
    for tie in answer.ambiguous:
        unsure = (
            " from ".join(tie.candidates)
            if len(tie.candidates) > 1
            else f"whether {tie.candidates[0]} is there"
        )
        console.print(f"These data cannot tell {unsure}; {tie.tell_apart_by} would.")
    for note in answer.notes:
        console.print(note)
