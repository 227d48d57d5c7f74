"""A study's diagnosis, from raw signals to stages: prepare, search, refit, judge, say what is left."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from impid_host.diagnosis.allowance import widened
from impid_host.diagnosis.arbitrate import arbitrated, exactly_compared
from impid_host.diagnosis.base import baseline
from impid_host.diagnosis.beside import curves_beside
from impid_host.diagnosis.case import Progress, prepare, saturated, silent
from impid_host.diagnosis.choice import Choice, chosen, evidence_of, ordered
from impid_host.diagnosis.floor import PER_COLUMN, noise_floor, resolution_of
from impid_host.diagnosis.judge import events_in_sealed, stretch_of, worse
from impid_host.diagnosis.leftover import odd_structures
from impid_host.diagnosis.parameters import holds_zero
from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.result import Chosen, Diagnosis, Evidence, Floor, Stage, Structure
from impid_host.diagnosis.stages import Bench, named_stages, unattributed
from impid_host.diagnosis.ties import chosen_slots
from impid_host.diagnosis.tolerance import in_words, with_tolerance
from impid_host.diagnosis.traces import traces
from impid_host.diagnosis.verdict import sentence
from impid_host.effects.bounds import negligible, on_its_bound, possible
from impid_host.robot.model import RobotModel
from impid_host.study.model import Study

_ABOVE = 1.5  # of the noise floor: what is left is more than chance and an inexact model leave
_NO_NAME = Evidence(0.0, 0.0, 0.0, 0.0)


def diagnose(study: Study, progress: Progress = silent, *, cutoff_hz: float | None = None) -> Diagnosis:
    """Find what the first model lacks, add it, and judge it on data that took no part.

    Args:
        cutoff_hz: of the band in which errors are told; None: the one that `fit` takes, by the motion.

    Raises:
        UndeterminedError: the data do not determine the robot or a load, or there is nothing to diagnose.
    """
    choice = chosen(prepare(study, progress, cutoff_hz), progress)
    case = choice.case
    progress("judging on data that took no part", 0.85)
    bench = Bench(case, choice.table.noise.taps, study.setup.handle_mass_kg, study.setup.prior_alpha)
    named, fit = stands(bench, named_parts(choice))
    choice, named, fit = exactly_compared(choice, bench, named, fit)
    verdict = arbitrated(choice, bench, dict(zip(named, fit.chosen, strict=True)), fit)
    certain = [s for s in named if s not in verdict.open_slots]
    stages, last = named_stages(bench, [named[s] for s in certain], _evidence(choice, certain))
    left = [*choice.left]
    if len(stages) > 1 and worse(stages[-1].rms, stages[0].rms, stretch_of(last.chosen)):
        left += [_not_upheld(stage) for stage in stages[1:]]
        stages, last = stages[:1], bench.plain
        verdict = replace(verdict, open_slots=(), covering=None, ties=())
    stages, last = with_last_stage(choice, bench, named, stages, last, left, verdict.open_slots)
    widest = with_tolerance(
        stages[-1], last, case.base, case.holdout, study.setup.prior_alpha, study.setup.tolerance
    )
    stages = (*stages[:-1], widest)
    if verdict.covering is not None:
        final = replace(stages[-1], alpha=verdict.covering.alpha, loads=verdict.covering.loads)
        stages = (*stages[:-1], final)
    told = floor_of(choice, last, left, study)
    floor = {key: told.value(key) for key in stages[-1].rms}
    above = above_floor(stages[-1], floor, left)
    if above and (left or choice.rejected):
        stages = (*stages[:-1], widened(stages[-1], floor))
    notes = [*notes_of(choice, last, stages[-1], study), *in_words(stages[-1])]
    return Diagnosis(
        study=study.name,
        baseline=baseline(
            study.setup, case.base.model, given=all(view.load is not None for view in case.views)
        ),
        fit_trials=case.holdout.fit,
        validation_trials=case.holdout.validation,
        stages=stages,
        floor=floor,
        told=told,
        traces=traces(bench, bench.plain, last),
        prismatic=all(case.base.model.prismatic),
        textbook=bench.textbook(stages[0]),
        ranges=case.setting.ranges,
        cutoff_hz=case.views[0].report_hz,
        share_unexplained=share_unexplained(stages[0].rms, stages[-1].rms, floor),
        above_noise_floor=above,
        structure=(*left, *odd_structures(case.oddities)),
        ambiguous=verdict.ties,
        verdict=sentence(
            stages,
            floor,
            verdict.ties,
            left,
            above,
            units={key: _unit(key, case.base.model) for key in floor},
            widened=bool(above and left),
        ),
        notes=tuple(notes),
    )


def _unit(channel: str, model: RobotModel) -> str:
    """N of forces and of joints that slide."""
    slides = channel.startswith("tau") and model.prismatic[int(channel[3:].partition("_")[0]) - 1]
    return "N" if slides or not channel.startswith("tau") else "N*m"


def named_parts(choice: Choice) -> dict[int, Chosen]:
    """The chosen names, the largest first, with the values of the search."""
    parts = dict(zip(choice.best.slots, chosen_slots(choice.table, choice.best), strict=True))
    return {s: parts[s] for s in ordered(choice)}


def stands(bench: Bench, named: Mapping[int, Chosen]) -> tuple[dict[int, Chosen], Refit]:
    """The names whose parameters are possible once everything is fitted exactly, and the fit of them."""
    kept = dict(named)
    while True:
        fit = bench.fit(list(kept.values()))
        bad = [
            s
            for s, part in zip(kept, fit.chosen, strict=True)
            if not possible(part.term, part.beta, part.shape)
            or negligible(part.term, part.beta, part.shape)
            or on_its_bound(part.term, part.beta, part.shape)
            or holds_zero(part)
        ]
        if not bad:
            return kept, fit
        # The smallest first: what it leaves may bring the others back within their bounds.
        del kept[bad[-1]]


def _evidence(choice: Choice, slots: Sequence[int]) -> list[Evidence]:
    return [evidence_of(choice, slots[:k], s) for k, s in enumerate(slots)]


def with_last_stage(
    choice: Choice,
    bench: Bench,
    named: Mapping[int, Chosen],
    stages: tuple[Stage, ...],
    last: Refit,
    left: Sequence[Structure],
    left_open: Sequence[int],
) -> tuple[tuple[Stage, ...], Refit]:
    """A last stage for what has no known cause, or has several: curves, and names that a tie leaves open."""
    if not left and not left_open:
        return stages, last
    on = [row.on for row in left] or list(stages[0].rms)
    parts = curves_beside(bench.case, [part for part in _curves(choice) if carries_over(part)], bench.taps)
    opened = [named[s] for s in left_open]
    evidence = replace(_NO_NAME, share_of_residual=min(1.0, sum(row.share for row in left)))
    fit = bench.fit([*last.chosen, *opened, *parts])
    stage = bench.stage(fit, unattributed(on, parts, evidence))
    if parts and worse(stage.rms, stages[-1].rms):
        fit = bench.fit([*last.chosen, *opened])
        stage = bench.stage(fit, unattributed(on, [], evidence))
    return (*stages, stage), fit


def carries_over(part: Chosen) -> bool:
    """Whether a curve can be taken out: it says something of other data, and is no dynamics like alpha."""
    return part.term.where[-1] not in ("time", "one_trial", "frequency")


def _curves(choice: Choice) -> list[Chosen]:
    parts = zip(choice.best.slots, chosen_slots(choice.table, choice.best), strict=True)
    return [part for s, part in parts if s in choice.unnamed]


def _not_upheld(stage: Stage) -> Structure:
    """What is said of names that predict the sealed part worse: there is something, and this is not it."""
    assert stage.added is not None
    own = stage.added
    joints = [name for name in own.where if name.startswith("joint")]
    on = f"tau{joints[0][5:]}" if joints else max(stage.rms, key=lambda key: stage.rms[key])
    none = np.zeros((0, 2))
    words = f"something resembles {own.label}, but with it data that took no part are predicted worse"
    return Structure("time", on, own.evidence.share_of_residual, none, none, words)


def floor_of(choice: Choice, fit: Refit, left: Sequence[Structure], study: Study) -> Floor:
    """What noise alone leaves in each held-out channel; the lines of what hums are no noise."""
    case = choice.case
    lines_Hz = [row.peak for row in left if row.variable == "frequency" and len(row.curve)]
    seconds = sum(float(view.valid.sum()) * view.dt for view in case.views)
    independent = 2 * case.views[0].report_hz * seconds
    rich = saturated(case.base, choice.table.slots, round(5 * independent / PER_COLUMN))
    used = {view.name for view in case.views}
    logs = [(trial.robot.tau, trial.robot.force) for trial in study.trials if trial.name in used]
    return noise_floor(case, fit, rich, lines_Hz, resolution_of(logs))


def above_floor(last: Stage, floor: Mapping[str, float | None], left: Sequence[Structure]) -> bool | None:
    """Whether more than noise is left; None where nothing tells the noise."""
    if left or any(vaf < 0 for vaf in last.vaf.values()):
        return True
    known = {key: value for key, value in floor.items() if value is not None}
    return any(last.rms[key] > _ABOVE * value for key, value in known.items()) if known else None


def share_unexplained(
    first: Mapping[str, float], last: Mapping[str, float], floor: Mapping[str, float | None]
) -> float:
    """What is above the floor with all names, as a share of the first residual, in units of the floor."""
    level = {key: floor.get(key) or value for key, value in last.items()}
    before = sum((first[key] / level[key]) ** 2 for key in first if level.get(key))
    after = sum(max((last[key] / level[key]) ** 2 - 1, 0.0) for key in first if level.get(key))
    return float(after / max(before, 1e-300))


def notes_of(choice: Choice, fit: Refit, last: Stage, study: Study) -> list[str]:
    """What a reader must know of the data that were used."""
    case = choice.case
    words = [f"{event.words}: left out of the fit" for event in choice.pushed]
    sealed = events_in_sealed(case, fit, choice.table.noise.taps)
    words += [f"{event.words}: it is in the error on data that took no part" for event in sealed]
    words += [
        f"what is left resembles {label} no more than it resembles other things" for label in choice.rejected
    ]
    words += unlike_its_model(last)
    if all(view.measured is None for view in case.views):
        words.append("no accelerometer: accelerations come from the angles, and its faults cannot be seen")
    unused = [trial.name for trial in study.of_kind("stochastic")]
    if unused:
        words.append(f"not used: {', '.join(unused)}; no effect is looked for in stochastic trials")
    return words


def unlike_its_model(last: Stage) -> list[str]:
    """Forces of a load that its model predicts worse than a constant would: no M, B, K describe it."""
    bad = [
        key for key, vaf in last.vaf.items() if vaf < 0 and key.startswith("f") and not key.startswith("fs")
    ]
    names = " and ".join(last.loads)
    return [
        f"{key}: the model of {names} predicts the held-out force worse than a constant does, so M, B and K "
        "describe what the robot holds in the fitted part at best"
        for key in bad
    ]
