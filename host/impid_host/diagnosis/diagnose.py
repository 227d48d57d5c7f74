"""A study's diagnosis, from raw signals to stages: prepare, choose, prove, say what is left."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.diagnosis.base import Base, base_of
from impid_host.diagnosis.bursts import Burst, are_pushes, bursts, without_bursts
from impid_host.diagnosis.choice import (
    Table,
    is_known,
    p_value,
    possible,
    pruned,
    score_of,
    supported,
    table_of,
)
from impid_host.diagnosis.dynamic import RESPONSE, is_response
from impid_host.diagnosis.evidence import base_directions, solve
from impid_host.diagnosis.final_look import carried
from impid_host.diagnosis.findings import findings_of
from impid_host.diagnosis.floor import PER_COLUMN, noise_floor, resolution_of
from impid_host.diagnosis.holdout import Holdout, hold_out
from impid_host.diagnosis.leftover import BETTER, explained, unmasked
from impid_host.diagnosis.lines import spectral_lines
from impid_host.diagnosis.oddities import Oddity
from impid_host.diagnosis.prepare import setting_of, views
from impid_host.diagnosis.proof import corrected
from impid_host.diagnosis.refit import Refit, refit
from impid_host.diagnosis.reported import upheld_stages, withdrawn_structure
from impid_host.diagnosis.result import Chosen, Diagnosis, Finding, Floor, Structure
from impid_host.diagnosis.rows import Run, Slot, Taps, build_runs, slots_of
from impid_host.diagnosis.shapes import structures
from impid_host.diagnosis.smooth import smooth_candidates
from impid_host.diagnosis.stages import Bench, unattributed_stage
from impid_host.diagnosis.ties import ties
from impid_host.diagnosis.traces import traces
from impid_host.diagnosis.unsteady import unsteady
from impid_host.diagnosis.wander import wandering
from impid_host.diagnosis.whiten import noise_models, whitened
from impid_host.effects.catalogue import candidates
from impid_host.effects.effect import no_gate
from impid_host.effects.view import View
from impid_host.errors import UndeterminedError
from impid_host.robot.model import robot_model
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import PUBLISHED_CUTOFF_HZ
from impid_host.study.model import Study

_ABOVE = 1.5  # of the noise floor: what is left is more than chance and an inexact model leave
_LARGE = 1.0  # an effect that lowers the mean squared innovation by so many times the noise's

Progress = Callable[[str, float], None]


def _silent(_words: str, _share: float) -> None:
    return


@dataclass(frozen=True, slots=True)
class Case:
    """A study prepared for the choice.

    Attributes:
        views: with the present model in them; runs: raw rows; taps: noise models.
    """

    views: tuple[View, ...]
    base: Base
    holdout: Holdout
    slots: tuple[Slot, ...]
    runs: tuple[Run, ...]
    taps: Taps
    table: Table
    oddities: tuple[Oddity, ...]


def diagnose(study: Study, progress: Progress = _silent) -> Diagnosis:
    """Find what the papers' model lacks, add it, and judge it on data that took no part.

    Raises:
        UndeterminedError: the data do not determine the robot or a load, or there is nothing to diagnose.
    """
    case = prepare(study, progress)
    progress("choosing", 0.7)
    case, active, curves = chosen_twice(case)
    pushed = bursts_of(case, [*active, *curves])
    if pushed:
        progress("choosing again without what stands out", 0.75)
        case, active, curves = chosen_twice(prepare(study, pushed=pushed))
    case, active, curves = confirmed(case, active, curves)
    active = upheld(case, active, curves)
    table = case.table
    findings = findings_of(case.table, active)
    progress("judging on held-out data", 0.85)
    prior = study.setup.prior_alpha
    bench = Bench(
        case.views,
        case.base,
        case.holdout,
        case.taps,
        study.setup.handle_mass_kg,
        None if prior is None else tuple(prior),
    )
    stages, fit, findings, withdrawn = upheld_stages(bench, findings)
    active = still_named(table, active, withdrawn)
    left = structures(table, active, curves, case.views)
    left += spectral_lines(table, [*active, *curves], case.taps)
    left += wandering(table, [*active, *curves], case.taps)
    if not left:
        left += unsteady_of(case, fit)
    left += [withdrawn_structure(finding, stages) for finding in withdrawn]
    first, last = stages[0].rms, stages[-1].rms
    if left:
        shown = [row.on for row in left]
        share = min(1.0, sum(row.share for row in left))
        parts = [part for part in curve_parts(table, active, curves) if carries(part)]
        unsure = least_sure(table, active, curves)
        unknown, fit = unattributed_stage(bench, fit, parts, shown, share, unsure)
        stages = (*stages, unknown)
    lines_Hz = [row.peak for row in left if row.variable == "frequency" and len(row.curve)]
    told = floor_of(case, fit, lines_Hz, study)
    floor = {key: own if (own := told.value(key)) is not None else value for key, value in last.items()}
    before = sum((first[key] / floor[key]) ** 2 for key in first)
    after = sum(max((last[key] / floor[key]) ** 2 - 1, 0.0) for key in first)
    left += [odd_structure(oddity) for oddity in case.oddities]
    if are_pushes(pushed, sum(float(view.t[-1]) for view in case.views)):
        left += [odd_structure(Oddity(burst.trial, "tau1", 0.0, burst.words)) for burst in pushed]
    notes = [burst.words for burst in pushed]
    if all(view.measured is None for view in case.views):
        notes.append("no accelerometer: accelerations come from the angles, and its faults cannot be seen")
    unused = [trial.name for trial in study.of_kind("stochastic")]
    if unused:
        notes.append(f"not used: {', '.join(unused)}; no effect is looked for in stochastic trials")
    return Diagnosis(
        study=study.name,
        fit_trials=case.holdout.fit,
        validation_trials=case.holdout.validation,
        stages=stages,
        floor=floor,
        told=told,
        traces=traces(bench, bench.fit([]), fit),
        prismatic=case.base.model.name == "slide-1d",
        share_unexplained=float(after / before),
        above_noise_floor=bool(left) or any(last[key] > _ABOVE * floor[key] for key in last),
        structure=tuple(left),
        ambiguous=tuple(ties(table, active)),
        notes=tuple(notes),
    )


def still_named(table: Table, active: Sequence[int], withdrawn: Sequence[Finding]) -> list[int]:
    """The slots without those of the findings that were withdrawn."""
    gone = {(f.effect, part.candidate.where) for f in withdrawn for part in f.parts}
    return [
        s for s in active if (table.slots[s].candidate.effect, table.slots[s].candidate.where) not in gone
    ]


def carries(part: Chosen) -> bool:
    """Whether a curve can be taken out: it says something of other data, and is no dynamics like alpha."""
    other = part.candidate.where[-1] not in ("time", "one_trial")
    return other and not part.candidate.variant.startswith(RESPONSE)


def curve_parts(table: Table, active: Sequence[int], curves: Sequence[int]) -> list[Chosen]:
    """The curves as parts of a model, with the values of the choice."""
    beta, rss = solve(table.G, table.columns([*active, *curves]))
    first = len(table.columns(active))
    parts = []
    for s in curves:
        slot = table.slots[s]
        size = slot.candidate.size
        columns = np.array(table.columns([s]), dtype=int) + 1
        covariance = np.linalg.pinv(table.G[np.ix_(columns, columns)]) * rss / table.rows
        candidate = replace(slot.candidate, shapes=(slot.shape,))
        parts.append(Chosen(candidate, slot.shape, beta[first : first + size], covariance))
        first += size
    return parts


def least_sure(table: Table, active: Sequence[int], curves: Sequence[int]) -> float:
    """The largest p-value among the curves; what has no curve was tested by its spectrum, at 0.001."""
    tests = [p_value(table, [*active, *(other for other in curves if other != s)], s) for s in curves]
    return max(tests, default=1e-3)


def unsteady_of(case: Case, fit: Refit) -> list[Structure]:
    """Parts of trials in which the final model leaves far more than in the others."""
    plain = [
        run
        for view in fit.views
        for run in build_runs(corrected(view, fit.chosen), case.base, [], case.holdout)
    ]
    return unsteady(plain, case.taps, case.base.size, fit.views)


def odd_structure(oddity: Oddity) -> Structure:
    """Rows that were left out, as an entry of what is unexplained."""
    none = np.zeros((0, 2))
    return Structure("one_trial", oddity.on, oddity.share, none, none, oddity.words)


def chosen_twice(case: Case, given: Sequence[int] = ()) -> tuple[Case, list[int], list[int]]:
    """The choice, then again what of it holds under a noise model fitted on what it leaves.

    The first noise model comes from a saturated regression, which takes slow noise for signal; the second
    sees all that is left, and so errs on the side of noise.

    Args:
        given: slots that are in the model whatever happens.
    """
    table, active, curves = unmasked(case.table, given)
    if not active and not curves:
        return replace(case, table=table), active, curves
    picked = [table.slots[s] for s in (*given, *active, *curves)]
    again, taps = second_opinion(case, picked)
    slots = list(range(len(again.slots) - len(picked), len(again.slots)))
    always, others = slots[: len(given)], slots[len(given) :]
    kept = pruned(again, always, others)
    active = [
        s
        for s in others[: len(active)]
        if s in kept and supported(again, [*always, *(o for o in kept if o != s)], s)
    ]
    curves = [s for s in others[len(others) - len(curves) :] if s in kept] if curves else []
    return replace(case, table=again, taps=taps), active, curves


def confirmed(case: Case, active: Sequence[int], curves: Sequence[int]) -> tuple[Case, list[int], list[int]]:
    """The choice once more, with the largest effect taken out of the signals themselves.

    What the linearised columns of an effect many times the noise leave over looks like other, smaller ones.
    """
    table = case.table
    if not active or len(active) + len(curves) < 2:
        return case, list(active), list(curves)
    top = max(active, key=lambda s: score_of(table, [o for o in (*active, *curves) if o != s], s))
    fine = any(table.slots[s].candidate.finer is not None for s in active)
    if not fine and score_of(table, [], top) < _LARGE * table.rows:
        return case, list(active), list(curves)
    name = table.slots[top].candidate.effect
    largest = [s for s in active if table.slots[s].candidate.effect == name]
    parts = [part for finding in findings_of(table, active) for part in finding.parts]
    fitted = refit(case.views, parts, case.base, case.holdout, case.taps)
    own = [part for part in fitted.chosen if part.candidate.effect == name]
    cleaned = [corrected(view, own) for view in fitted.views]
    again = evaluated(informed(cleaned, case.base, case.holdout), case.base, case.holdout)
    with_it = again.table
    for part in own:
        # What is left to the effect once it is taken out is a small correction, of either sign.
        with_it = with_it.with_shapes(replace(part.candidate, gate=no_gate), [part.shape])
    given = range(len(again.table.slots), len(with_it.slots))
    again, fresh, bent = chosen_twice(replace(again, table=with_it), list(given))
    picked = [again.table.slots[s] for s in (*fresh, *bent)]
    first = len(table.slots)
    for slot in picked:
        table = table.with_shapes(slot.candidate, [slot.shape])
    places = list(range(first, first + len(picked)))
    bent_places = places[len(fresh) :]
    kept = possible(table, [*largest, *places[: len(fresh)]], bent_places)
    return replace(case, table=table), kept, bent_places


def upheld(case: Case, active: Sequence[int], curves: Sequence[int]) -> list[int]:
    """The effects that lower the error on held-out data.

    The curves are taken into account where they explain clearly more; where they add little to what the
    names explain, they stand beside the names, not in their place.
    """
    by_names = explained(case.table, active)
    if by_names > (1.0 - BETTER) * explained(case.table, [*active, *curves]):
        curves = []
    slots = [case.table.slots[s] for s in (*curves, *active)]
    runs, _, fresh = own_runs(case, slots)
    sizes = [slot.candidate.size for slot in fresh[len(curves) :]]
    base = case.base.size + sum(slot.candidate.size for slot in fresh[: len(curves)])
    return [active[k] for k in carried(whitened(runs, case.taps), base, sizes)]


def bursts_of(case: Case, active: Sequence[int]) -> list[Burst]:
    """Stretches that the model with its effects and curves leaves standing out."""
    runs, columns, _ = own_runs(case, [case.table.slots[s] for s in active])
    return bursts(whitened(runs, case.taps), columns, case.views)


def own_runs(case: Case, picked: Sequence[Slot]) -> tuple[list[Run], int, list[Slot]]:
    """Raw rows of the base and the picked slots alone, how many columns, and the slots' new places."""
    first = case.base.size
    fresh = []
    for slot in picked:
        fresh.append(replace(slot, columns=slice(first, first + slot.candidate.size)))
        first += slot.candidate.size
    runs = [run for view in case.views for run in build_runs(view, case.base, fresh, case.holdout)]
    return runs, first, fresh


def second_opinion(case: Case, picked: Sequence[Slot]) -> tuple[Table, Taps]:
    """The table under a noise model of what the picked slots leave; they stand last in it."""
    raw, first, _ = own_runs(case, picked)
    taps = noise_models(raw, range(first), {})
    table = whitened_table(case.views, case.base, case.holdout, case.slots, case.runs, taps)
    for slot in picked:
        table = table.with_shapes(slot.candidate, [slot.shape])
    return table, taps


def floor_of(case: Case, fit: Refit, lines_Hz: Sequence[float], study: Study) -> Floor:
    """What noise alone leaves in each held-out channel."""
    seconds = sum(float(np.sum(view.valid)) * view.dt for view in case.views)
    columns = saturated(case.base, case.slots, round(5 * 2 * PUBLISHED_CUTOFF_HZ * seconds / PER_COLUMN))
    used = {view.name for view in case.views}
    logs = [(trial.robot.tau, trial.robot.force) for trial in study.trials if trial.name in used]
    steps = resolution_of(logs)
    return noise_floor(fit, case.base, case.holdout, case.runs, columns, lines_Hz, steps)


def prepare(study: Study, progress: Progress = _silent, pushed: Sequence[Burst] = ()) -> Case:
    """Align, leave out what is `pushed`, fit the papers' model, evaluate every candidate, whiten."""
    model = robot_model(study.setup.robot)
    progress("aligning", 0.0)
    parts, oddities = views(study, model)
    parts = [without_bursts(view, pushed) for view in parts]
    holdout = hold_out(parts)
    base = base_of(parts, model, prior=study.setup.prior_alpha is not None)
    progress("fitting the papers' model", 0.2)
    return evaluated(informed(parts, base, holdout), base, holdout, oddities, progress)


def evaluated(
    parts: Sequence[View],
    base: Base,
    holdout: Holdout,
    oddities: Sequence[Oddity] = (),
    progress: Progress = _silent,
) -> Case:
    """Every candidate's columns on the given views, whitened."""
    setting = setting_of(parts, base)
    slots = slots_of([*candidates(setting), *smooth_candidates(parts, setting)], base.size)
    runs: list[Run] = []
    for index, view in enumerate(parts):
        progress(f"evaluating the catalogue on {view.name}", 0.25 + 0.4 * index / len(parts))
        runs += build_runs(view, base, slots, holdout)
    rows = sum(len(run.target) for run in runs if run.part == "fit" and run.key == ("torque", 0))
    taps = noise_models(runs, saturated(base, slots, rows), {})
    return Case(
        tuple(parts),
        base,
        holdout,
        tuple(slots),
        tuple(runs),
        taps,
        whitened_table(parts, base, holdout, slots, runs, taps),
        tuple(oddities),
    )


def whitened_table(
    parts: Sequence[View],
    base: Base,
    holdout: Holdout,
    slots: Sequence[Slot],
    runs: Sequence[Run],
    taps: Taps,
) -> Table:
    """The rows that the choice works on: whitened, the base model regressed out, fit part alone."""
    fit = [run for run in whitened(runs, taps) if run.part == "fit"]
    Q = base_directions(fit, base.size)

    def freed(columns: list[Floats]) -> list[Floats]:
        stacked = np.concatenate(columns)
        stacked = stacked - Q @ (Q.T @ stacked)
        return np.split(stacked, np.cumsum([len(part) for part in columns])[:-1])

    def make(fresh: Sequence[Slot]) -> list[Floats]:
        first = fresh[0].columns.start + base.size
        moved = [_moved(slot, base.size) for slot in fresh]
        raw = [run for view in parts for run in build_runs(view, base, moved, holdout, first=first)]
        return freed([run.design for run in whitened(raw, taps) if run.part == "fit"])

    targets = freed([run.target[:, None] for run in fit])
    designs = freed([run.design[:, base.size :] for run in fit])
    plain = [
        replace(run, target=target[:, 0], design=design)
        for run, target, design in zip(fit, targets, designs, strict=True)
    ]
    return table_of(plain, [_moved(slot, -base.size) for slot in slots], make)


def _moved(slot: Slot, by: int) -> Slot:
    return replace(slot, columns=slice(slot.columns.start + by, slot.columns.stop + by))


def informed(parts: Sequence[View], base: Base, holdout: Holdout) -> list[View]:
    """The views with the papers' model, fitted by plain least squares, in them."""
    runs = [run for view in parts for run in build_runs(view, base, [], holdout)]
    scale = {
        key: 1 / (1e-12 + np.sqrt(np.mean(np.concatenate([r.target for r in runs if r.key == key]) ** 2)))
        for key in {run.key for run in runs}
        if key[0] in ("torque", "force")
    }
    weighed = [
        replace(run, target=run.target * scale[run.key], design=run.design * scale[run.key])
        for run in runs
        if run.key in scale
    ]
    fit = [run for run in weighed if run.part == "fit"]
    if sum(len(run.target) for run in fit) < 5 * base.size:
        raise UndeterminedError("too little is left between gaps and filter edges; record longer trials")
    design = np.concatenate([run.design for run in fit])
    size = np.linalg.norm(design, axis=0) + 1e-300
    target = np.concatenate([run.target for run in fit])
    value = np.linalg.lstsq(design / size, target, rcond=1e-10)[0] / size
    return [base.informed(view, value) for view in parts]


def saturated(base: Base, slots: Sequence[Slot], rows: int) -> list[int]:
    """Columns of the base, and of every candidate at a few shapes: what leaves nothing but noise.

    Args:
        rows: of a channel; a regression on more than a fifth as many columns would take noise for signal.
    """
    for most in (4, 2, 1):
        columns = list(range(base.size))
        for slot in slots:
            shapes = slot.candidate.shapes
            some = shapes[:: -(-len(shapes) // most)]
            if (is_known(slot) or slot.candidate.size < 8) and slot.shape in some:
                columns += range(slot.columns.start, slot.columns.stop)
        if len(columns) < rows / 5:
            break
    for slot in slots:
        # Without them the noise would take up what a resonance or a load's memory leaves.
        if is_response(slot.candidate) and len(columns) + slot.candidate.size < rows / 6:
            columns += range(slot.columns.start, slot.columns.stop)
    return columns
