"""`impid-host design trial`: the trial that would settle what a diagnosis left open."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np
import tomli_w
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from impid_host.cli.inputs import load_inputs
from impid_host.design.tie_file import OpenQuestions, read_ties
from impid_host.errors import InputError, UndeterminedError
from impid_host.report.wide_console import table_console
from impid_host.robot.model import ROBOTS
from impid_host.study.csv_table import write_columns
from impid_host.study.model import Study

if TYPE_CHECKING:
    from impid_host.design.tie_trials import Planned

_POSITIVE = click.FloatRange(0, min_open=True)


@click.command("trial")
@click.argument("study", type=click.Path(path_type=Path))
@click.option(
    "--for",
    "diagnosis",
    type=click.Path(path_type=Path, dir_okay=False),
    required=True,
    help="What `impid-host diagnose STUDY --json` wrote.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for reference.csv and trial.toml of the best trial.",
)
@click.option(
    "--range",
    "range_",
    type=_POSITIVE,
    metavar="DEG|MM",
    help="Largest range of a joint; default twice the study's.",
)
@click.option(
    "--speed-limit", type=_POSITIVE, metavar="RAD/S|M/S", help="Of every joint; default twice the study's."
)
@click.option("--duration", type=_POSITIVE, metavar="S", help="Default: that of the study's longest trial.")
@click.option(
    "--payload",
    "payloads",
    type=_POSITIVE,
    multiple=True,
    default=(0.5, 1.0, 2.0),
    show_default=True,
    metavar="KG",
    help="A mass that can be weighed and hung on; may be repeated.",
)
@click.option("--rate", type=_POSITIVE, default=1000.0, show_default=True, metavar="HZ")
@click.option("--json", "json_to", metavar="FILE|-", help="Also write the table as JSON.")
def trial(
    study: Path,
    diagnosis: Path,
    out: Path | None,
    range_: float | None,
    speed_limit: float | None,
    duration: float | None,
    payloads: tuple[float, ...],
    rate: float,
    json_to: str | None,
) -> None:
    """The trial that tells apart best what a diagnosis could not.

    For each trial that could be run it is worked out by how much better one explanation would predict it than
    the other, fitted to everything, does, in nats. What adds most is written as a reference for the robot's
    controller, with the words of what to hang on or to weigh.

    \b
    Example:
      impid-host design trial study/ --for diagnosis.json --out next_trial/
    """
    questions = read_ties(diagnosis)
    read = load_inputs([study], (), None)
    _fitting(study, read, questions)
    from impid_host.design.tie_trials import limits_of, prepared, ranked  # noqa: PLC0415  (a second in all)

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("aligning", total=1.0)

        def show(words: str, share: float) -> None:
            bar.update(task, description=words, completed=share)

        case = prepared(read, questions, show)
        slides = all(case.base.model.prismatic)
        limits = limits_of(
            case,
            range_rad=None if range_ is None else range_ / 1e3 if slides else float(np.deg2rad(range_)),
            speed=speed_limit,
            duration_s=duration,
            payloads_kg=payloads,
            rate_hz=rate,
        )
        plans = ranked(read, case, questions, limits, show)
    if json_to != "-":
        table_console().print(_table(plans, questions))
    best = plans[0]
    left = [labels for labels, done in zip(questions.ties, best.resolves, strict=True) if not done]
    if json_to is not None:
        _write_json(json_to, plans, questions)
    for labels, nats in zip(questions.ties, best.nats, strict=True):
        if labels in left:
            click.echo(_refusal(labels, nats), err=json_to == "-")
    if len(left) == len(questions.ties):
        raise UndeterminedError("no trial within these limits would settle what is open, so none is written")
    click.echo(_words(best, study, out), err=json_to == "-")
    if out is not None and best.candidate.motion is not None:
        _write(best, out)


def _fitting(path: Path, study: Study, questions: OpenQuestions) -> None:
    """The diagnosis is of this study, whose robot can be predicted."""
    if questions.study != study.name:
        what = f"is of the study {questions.study}, not of {study.name}"
        raise InputError(questions.path, what, f"diagnose {path} with --json, or name that study")
    if ROBOTS[study.setup.robot.model].described:
        raise InputError(
            path, "design needs the robot's own model, not a URDF", "use a planar model or a single axis"
        )


def _table(plans: "list[Planned]", questions: OpenQuestions) -> Table:
    from impid_host.design.tie_trials import ENOUGH_NATS  # noqa: PLC0415

    table = Table(title=f"Nats that each would add ({ENOUGH_NATS:.0f} settle a tie in 19 of 20)")
    table.add_column("trial")
    for labels in questions.ties:
        table.add_column(_tie(labels), justify="right")
    for plan in plans:
        table.add_row(plan.candidate.words, *(f"{nats:.1f}" for nats in plan.nats))
    return table


def _tie(labels: tuple[str, ...]) -> str:
    return " / ".join(labels) if len(labels) > 1 else f"{labels[0]} / nothing"


def _refusal(labels: tuple[str, ...], nats: float) -> str:
    from impid_host.design.tie_trials import ENOUGH_NATS  # noqa: PLC0415
    from impid_host.effects.catalogue import telling_trial  # noqa: PLC0415

    which = " and ".join(labels) if len(labels) > 1 else f"{labels[0]} and nothing"
    how = (
        "are the same by their equations in every trial tried"
        if nats < 1.0
        else f"are told apart by {nats:.1f} nats at best, of {ENOUGH_NATS:.0f} that it takes"
    )
    return f"{which} {how}; what would tell: {telling_trial(labels)}."


def _words(best: "Planned", study: Path, out: Path | None) -> str:
    own = best.candidate
    if own.motion is None:
        then = "Write payload_kg into trial.toml of each of their trials, and diagnose again."
        return f"Best: {own.words}. {then}"
    where = "reference.csv" if out is None else str(out / "reference.csv")
    hang = f" Hang {own.payload_kg:g} kg, weighed, in the payload's place." if own.payload_kg else ""
    load = f" Put {own.load} on the end-effector." if own.load and not own.payload_kg else ""
    play = (
        f" Let the controller follow {where} ({own.motion.t[-1]:.0f} s),"
        if out
        else " With --out it is written;"
    )
    return (
        f"Best: {own.words}.{hang}{load}{play} log it as the other trials into {study / best.name}/ with "
        "the trial.toml beside it, and diagnose again."
    )


def _write(best: "Planned", out: Path) -> None:
    from impid_host.design.tie_motions import columns_of  # noqa: PLC0415

    own = best.candidate
    assert own.motion is not None
    head: dict[str, object] = {"kind": best.kind, "note": own.words}
    if best.load is not None:
        head["load"] = best.load
    if own.payload_kg is not None:
        head["payload_kg"] = own.payload_kg
    try:
        out.mkdir(parents=True, exist_ok=True)
        write_columns(out / "reference.csv", dict(columns_of(own.motion)))
        (out / "trial.toml").write_bytes(tomli_w.dumps(head).encode())
    except OSError as error:
        raise InputError(out, f"cannot be written ({error.strerror})", "choose another --out") from error


def _write_json(to: str, plans: "list[Planned]", questions: OpenQuestions) -> None:
    from impid_host.design.tie_trials import ENOUGH_NATS  # noqa: PLC0415

    content = {
        "format": "impid-tie-trials/1",
        "ties": [list(labels) for labels in questions.ties],
        "enough_nats": ENOUGH_NATS,
        "trials": [
            {
                "words": plan.candidate.words,
                "nats": list(plan.nats),
                "resolves": list(plan.resolves),
                "folder": plan.name if plan.candidate.motion is not None else None,
                "kind": plan.kind,
                "load": plan.load,
                "springs_of": plan.candidate.load,
                "payload_kg": plan.candidate.payload_kg,
                "weigh": list(plan.candidate.weighed),
            }
            for plan in plans
        ],
    }
    text = json.dumps(content, indent=2, allow_nan=False)
    if to == "-":
        click.echo(text)
    else:
        Path(to).write_text(text + "\n", encoding="utf-8")
