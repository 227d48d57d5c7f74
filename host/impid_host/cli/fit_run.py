"""What `impid-host fit` does with a study that was read: check, fit, hold against physics, show, write."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click
from rich.console import Console

from impid_host.checks import Agreement, Checks, agreement, check_study
from impid_host.checks.of_fit import gate_fit
from impid_host.checks.pushes import Pushes, find_pushes
from impid_host.cli.checked import IMPOSSIBLE, refused, unconfirmed
from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import Options, Progress, StudyFit, default_chain, fit_study
from impid_host.impedance.identify import LoadFit
from impid_host.impedance.joint_space import Limb, joint_impedance
from impid_host.impedance.rows import Split
from impid_host.report.check_tables import print_above, print_below
from impid_host.report.fit_parts import Besides, print_fit
from impid_host.report.wide_console import table_console
from impid_host.signals.chain import CHAINS, DEFAULT, Chain
from impid_host.study.model import Study

if TYPE_CHECKING:
    from impid_host.diagnosis.result import Chosen
    from impid_host.diagnosis.reuse import Provenance
    from impid_host.diagnosis.saved import SavedModel
    from impid_host.impedance.constrained import Constrained
    from impid_host.impedance.estimators.estimated import EstimatorWish
    from impid_host.impedance.reflex import Band, ReflexFit
    from impid_host.impedance.varying.fit import VaryingFit
    from impid_host.impedance.varying.schedule import Schedule
    from impid_host.report.fit_json import Json

    Curves = tuple[VaryingFit, ...]

Pair = tuple[float, float]


@dataclass(frozen=True)
class Wishes:
    """The command's options; `limb`: lengths of upper arm and forearm, place of the shoulder (m), side."""

    chain: str
    acceleration: Literal["accelerometer", "angles"] | None
    cutoff_hz: float | None
    terms: tuple[str, ...]
    reflex: bool
    estimator: "EstimatorWish"
    held_out_s: float
    model: Path | None
    keep_robot: bool
    save_model: Path | None
    physical: bool
    urdf: Path | None
    varying: "Schedule | None"
    constrain: bool
    limb: tuple[Pair, Pair, str] | None
    json_to: str | None
    figures: Path | None


def run(study: Study, wishes: Wishes) -> None:
    """Everything, to the exit status."""
    json_to = wishes.json_to
    row = _chain(study, wishes.chain, wishes.cutoff_hz)
    split = Split(wishes.held_out_s)
    options = Options(row, wishes.acceleration, wishes.terms, split, wishes.physical, wishes.estimator)
    saved = None if wishes.model is None else _saved(wishes.model)
    drawn = None
    with Console(stderr=True).status("checking") as status:
        answer = _answer(study, options, saved, status.update, wishes)
        curves = _curves(study, answer.result, row, wishes.varying, status.update)
        if wishes.figures is not None:
            status.update("drawing")
            from impid_host.report.fit_figures import draw_study  # noqa: PLC0415  (matplotlib is slow to import)

            drawings = draw_study(answer.result, wishes.figures, answer.pushes)
            if curves:
                from impid_host.report.varying_figure import draw_varying  # noqa: PLC0415

                drawings += draw_varying(curves, answer.result.loads, wishes.figures)
            drawn = f"{len(drawings)} figures in {wishes.figures}"
    _save(wishes.save_model, answer.result, study, options)
    if wishes.urdf is not None:
        _write_urdf(study, answer.result, wishes.urdf)
    besides = _besides(study, answer, curves, wishes)
    for line in [] if answer.provenance is None else answer.provenance.warnings:
        click.echo(line, err=True)
    if json_to != "-":
        _show(answer, besides, unconfirmed(study))
        if drawn is not None:
            click.echo(drawn)
    if json_to is not None:
        from impid_host.report.sessions_json import sessions_json  # noqa: PLC0415

        _write(json.dumps(_document(answer, besides) | sessions_json(study), indent=2), json_to)
    if answer.checks.impossible:
        raise SystemExit(IMPOSSIBLE)


def _write_urdf(study: Study, result: StudyFit, path: Path) -> None:
    source = study.setup.robot.urdf
    if source is None or result.physical is None:
        raise click.UsageError('--urdf goes with model = "urdf" in setup.toml and with free trials')
    from impid_host.robot.urdf_file import read_chain  # noqa: PLC0415  (few ask for it)
    from impid_host.robot.urdf_write import with_inertias  # noqa: PLC0415

    joints = read_chain(source, study.setup.robot.joints).joints
    _write(with_inertias(source, joints, result.physical.links), str(path))


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
    saved: "SavedModel | None",
    progress: Progress,
    wishes: Wishes,
) -> _Answer:
    """Check, fit, and hold the fit against physics and against what was measured twice."""
    checks = check_study(study)
    provenance: Provenance | None = None
    effects: tuple[Chosen, ...] = ()
    try:
        if saved is None:
            result = fit_study(study, options, progress)
        else:
            from impid_host.checks.of_diagnosis import of_input  # noqa: PLC0415
            from impid_host.diagnosis.reuse import fit_with_model  # noqa: PLC0415  (the catalogue is slow to import)

            reused = fit_with_model(study, saved, options, progress, keep_robot=wishes.keep_robot)
            result, provenance, effects = reused.fit, reused.provenance, reused.effects
            # What is judged is the study with the model's effects taken out.
            checks = of_input(checks)
    except UndeterminedError as error:
        refused(study, checks, error, wishes.json_to)
    twice = agreement(study, result.loads)
    checks = checks.with_more(gate_fit(result, effects)).with_more(twice.checks)
    progress("looking for pushes")
    return _Answer(result, provenance, checks, twice, find_pushes(study, result, options))


def _besides(study: Study, answer: _Answer, curves: "Curves", wishes: Wishes) -> Besides:
    handle, result = study.setup.handle_mass_kg, answer.result
    arms = [fit for fit in result.loads if fit.model.name == "arm" and len(fit.model.axes) == 2]
    joints = []
    if wishes.limb is not None:
        lengths, shoulder, side = wishes.limb
        joints = [joint_impedance(fit, Limb(*lengths, shoulder, side), handle) for fit in arms]
    return Besides(
        pushes=answer.pushes,
        agreement=answer.measured_twice,
        constrained=_constrained(arms, handle) if wishes.constrain else [],
        joints=joints,
        reflexes=_reflexes(result, wishes.held_out_s) if wishes.reflex else {},
        curves=curves,
    )


def _curves(
    study: Study, result: StudyFit, row: Chain, schedule: "Schedule | None", progress: Progress
) -> "Curves":
    """Impedance over time or another variable, where it was asked for."""
    if schedule is None:
        return ()
    from impid_host.impedance.varying.campaign import vary_study  # noqa: PLC0415  (few ask for it)

    return vary_study(study, result, row, schedule, progress)


def _show(answer: _Answer, besides: Besides, assumption: str) -> None:
    console = table_console()
    print_above(console, answer.checks)
    for line in [] if answer.provenance is None else answer.provenance.lines:
        click.echo(line)
    print_fit(console, answer.result, besides, marked=not answer.checks.trusted)
    print_below(console, answer.checks)
    if assumption:
        click.echo(assumption)


def _document(answer: _Answer, besides: Besides) -> "Json":
    from impid_host.report.fit_json import fit_json  # noqa: PLC0415  (where somebody asks for it)

    document = fit_json(answer.result, besides, checks=answer.checks)
    if answer.provenance is not None:
        document["model"] = asdict(answer.provenance)
    return document


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


def _constrained(arms: list[LoadFit], handle_kg: float) -> "list[Constrained]":
    from impid_host.impedance.constrained import constrain  # noqa: PLC0415  (few ask for it)

    return [constrain(fit, handle_kg) for fit in arms]


def _reflexes(result: StudyFit, held_out_s: float) -> "dict[str, tuple[ReflexFit, Band]]":
    from impid_host.impedance.reflex import fit_trial_reflex  # noqa: PLC0415  (few ask for it)

    arms = [trial for trial in result.trials if trial.kind == "arm"]
    if not arms:
        raise UndeterminedError(f"study {result.study}: no arm trial, so there is no reflex to fit")
    return {trial.name: fit_trial_reflex(trial, held_out_s) for trial in arms}


def _saved(path: Path) -> "SavedModel":
    from impid_host.diagnosis.saved import read_model  # noqa: PLC0415  (with it all of the diagnosis)

    return read_model(path)
