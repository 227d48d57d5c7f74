"""`impid-host fit`: the robot, then the load or arm, of a study."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click
from rich.console import Console

from impid_host.checks import Agreement, Checks, agreement, check_study
from impid_host.checks.of_diagnosis import of_input
from impid_host.checks.of_fit import gate_fit
from impid_host.checks.pushes import Pushes, find_pushes
from impid_host.cli.checked import IMPOSSIBLE, refused, unconfirmed
from impid_host.cli.inputs import load_inputs
from impid_host.cli.pair import PAIR
from impid_host.diagnosis.saved import SavedModel, read_model
from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import Options, Progress, StudyFit, default_chain, fit_study
from impid_host.impedance.constrained import constrain as constrain_matrices
from impid_host.impedance.joint_space import Limb, joint_impedance
from impid_host.impedance.reflex import Band, ReflexFit, fit_trial_reflex
from impid_host.impedance.rows import Split
from impid_host.impedance.varying.campaign import vary_study
from impid_host.impedance.varying.schedule import Schedule
from impid_host.report.check_tables import print_above, print_below
from impid_host.report.fit_json import Json, fit_json
from impid_host.report.fit_parts import Besides, print_fit
from impid_host.report.sessions_json import sessions_json
from impid_host.report.wide_console import table_console
from impid_host.robot.terms import TERMS
from impid_host.signals.chain import CHAINS, DEFAULT, Chain
from impid_host.study.model import Study

if TYPE_CHECKING:
    from impid_host.diagnosis.result import Chosen
    from impid_host.diagnosis.reuse import Provenance

REFLEX = "load.delay"


@click.command()
@click.argument(
    "paths", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="STUDY|RECORDING..."
)
@click.option(
    "--robot-log",
    multiple=True,
    type=click.Path(path_type=Path),
    help="Robot log (CSV) of each recording, in order.",
)
@click.option("--setup", type=click.Path(path_type=Path), help="setup.toml that goes with recordings.")
@click.option(
    "--chain",
    type=click.Choice(list(CHAINS)),
    default="default",
    show_default=True,
    help="Signal chain: ours, as published by Dyck and Tavakoli, or as the EMPS benchmark's authors did it.",
)
@click.option(
    "--acceleration",
    type=click.Choice(["accelerometer", "angles"]),
    help="Where accelerations come from; by default the accelerometer where there is one.",
)
@click.option(
    "--cutoff",
    type=click.FloatRange(0.5, 200),
    metavar="HZ",
    help="Cut-off of the default chain; by default twice the band of the motion, 4.5 Hz at least.",
)
@click.option(
    "--with",
    "terms",
    multiple=True,
    type=click.Choice([*TERMS, REFLEX]),
    metavar="EFFECT",
    help=f"Add a term to the robot model; may be repeated. One of {', '.join(TERMS)}; or {REFLEX}, the late "
    "stretch reflex of a limb on a joint-1d.",
)
@click.option(
    "--validate",
    type=click.FloatRange(0),
    default=10.0,
    show_default=True,
    metavar="SECONDS",
    help="Hold out the end of each trial for validation (at most a fifth); 0 fits everything.",
)
@click.option(
    "--model",
    "model_file",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Take the effects of a saved model (`diagnose --save-model`) out of the signals first.",
)
@click.option(
    "--saved-robot", is_flag=True, help="With --model: its robot parameters, even if trials are free."
)
@click.option(
    "--save-model",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Write robot and loads as a model without effects, for `impid-host judge`.",
)
@click.option(
    "--physical", is_flag=True, help="Also give the robot's links inertias that a body can have (URDF)."
)
@click.option(
    "--varying",
    metavar="time|posture|since:COLUMN|COLUMN",
    help="Also give K, B and x0 as curves with 95 % bands: over time (each trial by itself), over the slow "
    "part of the posture, over a column of robot.csv, or over the time since a column last rose.",
)
@click.option("--constrain", is_flag=True, help="Also give M and K of arms symmetric and positive definite.")
@click.option("--limb", type=PAIR, metavar="UPPER,FORE", help="Limb lengths, m: also give joint impedance.")
@click.option("--shoulder", type=PAIR, metavar="X,Y", help="Where the shoulder is, m, in the robot's frame.")
@click.option("--side", type=click.Choice(["right", "left"]), default="right", help="Which arm it is.")
@click.option(
    "--json", "json_to", metavar="FILE|-", help="Also write the result as JSON (- for standard output)."
)
@click.option(
    "--figures", type=click.Path(path_type=Path, file_okay=False), help="Write figures (PNG) to this folder."
)
def command(
    paths: tuple[Path, ...],
    robot_log: tuple[Path, ...],
    setup: Path | None,
    chain: str,
    acceleration: Literal["accelerometer", "angles"] | None,
    cutoff: float | None,
    terms: tuple[str, ...],
    validate: float,
    model_file: Path | None,
    saved_robot: bool,
    save_model: Path | None,
    physical: bool,
    varying: str | None,
    constrain: bool,
    limb: tuple[float, float] | None,
    shoulder: tuple[float, float] | None,
    side: str,
    json_to: str | None,
    figures: Path | None,
) -> None:
    """Identify the robot, then the load or arm, with 95 % intervals.

    The robot's parameters come from the free trials (or from [prior] in setup.toml when there are none);
    then every load, all its trials together, by Method 1 (virtual force sensor) and, where the log has
    forces, Method 2 (physical sensor). Stochastic trials also go through the spectral method, with a
    statement of where the two disagree. What a trial is stands in its trial.toml.

    \b
    Examples:
      impid-host fit study/
      impid-host fit study/ --json result.json --figures figures/
      impid-host fit panda/ --with friction.coulomb --with actuator.offset --physical
      impid-host fit arm_study/ --constrain --limb 0.30,0.33 --shoulder 0.37,-0.50
      impid-host fit arm_study/ --varying time --figures figures/
      impid-host fit next_study/ --model model.json
      impid-host fit study/ --save-model plain.json
      impid-host fit ankle/ --with load.delay --cutoff 40 --validate 20
      impid-host fit emps/ --chain emps --with friction.coulomb --with actuator.offset --validate 0
    """
    geometry = _limb(limb, shoulder, side)
    if save_model is not None and model_file is not None:
        raise click.UsageError("--save-model writes a model without effects: leave --model out")
    schedule = None if varying is None else Schedule(varying)
    study = load_inputs(paths, robot_log, setup, _columns(schedule))
    row = _chain(study, chain, cutoff)
    own_terms = tuple(term for term in terms if term != REFLEX)
    options = Options(row, acceleration, own_terms, Split(validate), physical)
    errors = Console(stderr=True)
    saved = None if model_file is None else _saved(model_file, chain)
    drawn = None
    with errors.status("checking") as status:
        answer = _answer(study, options, saved, status.update, keep_robot=saved_robot, json_to=json_to)
        curves = () if schedule is None else vary_study(study, answer.result, row, schedule, status.update)
        if figures is not None:
            status.update("drawing")
            from impid_host.report.fit_figures import draw_study  # noqa: PLC0415  (matplotlib is slow to import)
            from impid_host.report.varying_figure import draw_varying  # noqa: PLC0415

            drawings = draw_study(answer.result, figures, answer.pushes)
            drawings += draw_varying(curves, answer.result.loads, figures)
            drawn = f"{len(drawings)} figures in {figures}"
    _save(save_model, answer.result, study, options)
    handle = study.setup.handle_mass_kg
    arms = [fit for fit in answer.result.loads if fit.model.name == "arm" and len(fit.model.axes) == 2]
    besides = Besides(
        pushes=answer.pushes,
        agreement=answer.measured_twice,
        constrained=[constrain_matrices(fit, handle) for fit in arms] if constrain else [],
        joints=[] if geometry is None else [joint_impedance(fit, geometry, handle) for fit in arms],
        reflexes=_reflexes(answer.result, validate) if REFLEX in terms else {},
        curves=curves,
    )
    for line in [] if answer.provenance is None else answer.provenance.warnings:
        click.echo(line, err=True)
    if json_to != "-":
        _show(answer, besides, unconfirmed(study))
        if drawn is not None:
            click.echo(drawn)
    if json_to is not None:
        _write(json.dumps(_document(answer, besides) | sessions_json(study), indent=2), json_to)
    if answer.checks.impossible:
        raise SystemExit(IMPOSSIBLE)


@dataclass(frozen=True)
class _Answer:
    """A fit and what is to be said about it; `provenance` of a saved model, where one was used."""

    result: StudyFit
    provenance: "Provenance | None"
    checks: Checks
    measured_twice: Agreement
    pushes: Pushes


def _answer(
    study: Study,
    options: Options,
    saved: SavedModel | None,
    progress: Progress,
    *,
    keep_robot: bool,
    json_to: str | None,
) -> _Answer:
    """Check, fit, and hold the fit against physics and against what was measured twice."""
    checks = check_study(study)
    provenance: Provenance | None = None
    effects: tuple[Chosen, ...] = ()
    try:
        if saved is None:
            result = fit_study(study, options, progress)
        else:
            from impid_host.diagnosis.reuse import fit_with_model  # noqa: PLC0415  (the catalogue is slow to import)

            reused = fit_with_model(study, saved, options, progress, keep_robot=keep_robot)
            result, provenance, effects = reused.fit, reused.provenance, reused.effects
            # What is judged is the study with the model's effects taken out.
            checks = of_input(checks)
    except UndeterminedError as error:
        refused(study, checks, error, json_to)
    twice = agreement(study, result.loads)
    checks = checks.with_more(gate_fit(result, effects)).with_more(twice.checks)
    progress("looking for pushes")
    return _Answer(result, provenance, checks, twice, find_pushes(study, result, options))


def _show(answer: _Answer, besides: Besides, assumption: str) -> None:
    console = table_console()
    print_above(console, answer.checks)
    for line in [] if answer.provenance is None else answer.provenance.lines:
        click.echo(line)
    print_fit(console, answer.result, besides, marked=not answer.checks.trusted)
    print_below(console, answer.checks)
    if assumption:
        click.echo(assumption)


def _document(answer: _Answer, besides: Besides) -> Json:
    document = fit_json(answer.result, besides, checks=answer.checks)
    if answer.provenance is not None:
        document["model"] = asdict(answer.provenance)
    return document


def _columns(schedule: Schedule | None) -> tuple[str, ...]:
    own = None if schedule is None else schedule.column
    return () if own is None or own == "sync" else (own,)


def _chain(study: Study, name: str, cutoff: float | None) -> Chain:
    if cutoff is not None:
        return CHAINS[name].with_cutoff(cutoff)
    return default_chain(study) if name == DEFAULT.name else CHAINS[name]


def _save(path: Path | None, result: StudyFit, study: Study, options: Options) -> None:
    """The model as it was fitted, and the textbook's on the same aligned data."""
    if path is None:
        return
    from impid_host.diagnosis.saved import fit_json as model_json  # noqa: PLC0415  (the catalogue is slow to import)
    from impid_host.diagnosis.saved import write_model  # noqa: PLC0415
    from impid_host.diagnosis.textbook import textbook_fit  # noqa: PLC0415

    write_model(model_json(result, study, textbook_fit(study, result, options)), path)


def _write(text: str, to: str) -> None:
    if to == "-":
        click.echo(text)
    else:
        Path(to).write_text(text + "\n", encoding="utf-8")


def _reflexes(result: StudyFit, held_out_s: float) -> dict[str, tuple[ReflexFit, Band]]:
    arms = [trial for trial in result.trials if trial.kind == "arm"]
    if not arms:
        raise UndeterminedError(f"study {result.study}: no arm trial, so there is no reflex to fit")
    return {trial.name: fit_trial_reflex(trial, held_out_s) for trial in arms}


def _saved(path: Path, chain: str) -> SavedModel:
    if chain != "default":
        raise click.UsageError("--model goes with --chain default: its effects act on those signals")
    return read_model(path)


def _limb(limb: tuple[float, float] | None, shoulder: tuple[float, float] | None, side: str) -> Limb | None:
    if limb is None:
        return None
    if shoulder is None:
        raise click.UsageError("--limb needs to know where the shoulder is: add --shoulder X,Y")
    if min(limb) <= 0:
        raise click.UsageError("--limb: lengths must be positive, in metres")
    return Limb(*limb, shoulder, side)
