"""A study's diagnosis, from raw signals to stages: prepare, choose, prove, say what is left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from impid_host.diagnosis.bursts import Burst
from impid_host.diagnosis.case import Case, Progress, prepare, silent
from impid_host.diagnosis.findings import findings_of
from impid_host.diagnosis.references import Reference, against_prior, against_scales
from impid_host.diagnosis.reported import upheld_stages, withdrawn_structure
from impid_host.diagnosis.result import Diagnosis, Finding, Floor, Stage
from impid_host.diagnosis.rounds import bursts_of, chosen_twice, confirmed, upheld
from impid_host.diagnosis.stages import Bench
from impid_host.diagnosis.table import Table
from impid_host.diagnosis.ties import ties
from impid_host.diagnosis.traces import traces
from impid_host.diagnosis.unexplained import floor_of, left_out, left_over, unknown_stage
from impid_host.study.model import Study

_ABOVE = 1.5  # of the noise floor: what is left is more than chance and an inexact model leave


@dataclass(frozen=True, slots=True)
class Choice:
    """What was chosen, as slots of the case's table.

    Attributes:
        active: of effects; curves: without a cause; pushed: stretches that were left out for it.
    """

    case: Case
    active: tuple[int, ...]
    curves: tuple[int, ...]
    pushed: tuple[Burst, ...]


def diagnose(study: Study, progress: Progress = silent) -> Diagnosis:
    """Find what the papers' model lacks, add it, and judge it on data that took no part.

    Raises:
        UndeterminedError: the data do not determine the robot or a load, or there is nothing to diagnose.
    """
    choice = chosen(study, progress)
    case, curves = choice.case, choice.curves
    progress("judging on held-out data", 0.85)
    bench = bench_of(case, study)
    stages, fit, withdrawn = upheld_stages(bench, findings_of(case.table, choice.active))
    active = still_named(case.table, choice.active, withdrawn)
    left = left_over(case, active, curves, fit)
    left += [withdrawn_structure(finding, stages) for finding in withdrawn]
    first, last = stages[0].rms, stages[-1].rms
    if left:
        unknown, fit = unknown_stage(bench, case.table, active, curves, fit, left, last)
        stages = (*stages, unknown)
    told = floor_of(case, fit, left, study)
    known = Reference() if left else references_of(case, stages[-1], study)
    floor = floor_by_channel(told, last)
    left += left_out(case, choice.pushed)
    return Diagnosis(
        study=study.name,
        fit_trials=case.holdout.fit,
        validation_trials=case.holdout.validation,
        stages=stages,
        floor=floor,
        told=told,
        traces=traces(bench, bench.fit([]), fit),
        prismatic=case.base.model.name == "slide-1d",
        share_unexplained=share_unexplained(first, last, floor),
        above_noise_floor=bool(left) or any(last[key] > _ABOVE * floor[key] for key in last),
        structure=tuple(left),
        ambiguous=(*ties(case.table, active), *known.ties),
        notes=(*notes(case, choice.pushed, study), *known.notes),
    )


def chosen(study: Study, progress: Progress = silent) -> Choice:
    """The effects and curves that the fit part supports and held-out data do not speak against."""
    case = prepare(study, progress)
    progress("choosing", 0.7)
    case, active, curves = chosen_twice(case)
    pushed = bursts_of(case, [*active, *curves])
    if pushed:
        progress("choosing again without what stands out", 0.75)
        case, active, curves = chosen_twice(prepare(study, pushed=pushed))
    case, active, curves = confirmed(case, active, curves)
    return Choice(case, tuple(upheld(case, active, curves)), tuple(curves), tuple(pushed))


def bench_of(case: Case, study: Study) -> Bench:
    """What the stages of this study are fitted on."""
    prior = study.setup.prior_alpha
    known = None if prior is None else tuple(prior)
    return Bench(case.views, case.base, case.holdout, case.taps, study.setup.handle_mass_kg, known)


def still_named(table: Table, active: Sequence[int], withdrawn: Sequence[Finding]) -> list[int]:
    """The slots without those of the findings that were withdrawn."""
    gone = {(f.effect, part.candidate.where) for f in withdrawn for part in f.parts}
    return [
        s for s in active if (table.slots[s].candidate.effect, table.slots[s].candidate.where) not in gone
    ]


def floor_by_channel(told: Floor, rms: Mapping[str, float]) -> dict[str, float]:
    """The floor of every channel; where nothing tells it, the error itself."""
    return {key: own if (own := told.value(key)) is not None else value for key, value in rms.items()}


def share_unexplained(
    first: Mapping[str, float], last: Mapping[str, float], floor: Mapping[str, float]
) -> float:
    """What is above the floor with all names, as a share of the papers' residual, in units of the floor."""
    before = sum((first[key] / floor[key]) ** 2 for key in first)
    after = sum(max((last[key] / floor[key]) ** 2 - 1, 0.0) for key in first)
    return float(after / before)


def references_of(case: Case, stage: Stage, study: Study) -> Reference:
    """The prior's robot and the weighed payloads against what the last stage found."""
    model, prior = case.base.model, study.setup.prior_alpha
    found = Reference()
    if prior is not None and stage.alpha_names == tuple(model.parameter_names):
        found = against_prior(prior, model, stage.alpha)
    weights: dict[str, set[float]] = {}
    for trial in study.of_kind("mass-spring"):
        weights.setdefault(trial.load, set()).add(trial.payload_kg or 0.0)
    weighed = {load: masses.pop() for load, masses in weights.items() if len(masses) == 1}
    felt = any(view.measured is not None for view in case.views)
    scales = against_scales(weighed, stage, model.joints, accelerometer=felt)
    return Reference((*found.ties, *scales.ties), (*found.notes, *scales.notes))


def notes(case: Case, pushed: Sequence[Burst], study: Study) -> list[str]:
    """What a reader must know of the data that were used."""
    words = [burst.words for burst in pushed]
    if all(view.measured is None for view in case.views):
        words.append("no accelerometer: accelerations come from the angles, and its faults cannot be seen")
    unused = [trial.name for trial in study.of_kind("stochastic")]
    if unused:
        words.append(f"not used: {', '.join(unused)}; no effect is looked for in stochastic trials")
    return words
