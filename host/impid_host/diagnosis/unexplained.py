"""What the named effects leave: as structure, as curves in a last stage, against the floor of noise."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from impid_host.diagnosis.bursts import Burst, are_pushes
from impid_host.diagnosis.case import Case, saturated
from impid_host.diagnosis.dynamic import RESPONSE
from impid_host.diagnosis.evidence import solve
from impid_host.diagnosis.floor import PER_COLUMN, noise_floor, resolution_of
from impid_host.diagnosis.lines import spectral_lines
from impid_host.diagnosis.oddities import Oddity
from impid_host.diagnosis.proof import corrected
from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.reported import is_worse
from impid_host.diagnosis.result import Chosen, Floor, Stage, Structure
from impid_host.diagnosis.rows import build_runs
from impid_host.diagnosis.sample import sampled
from impid_host.diagnosis.shapes import structures
from impid_host.diagnosis.stages import Bench, unattributed_stage
from impid_host.diagnosis.support import p_value
from impid_host.diagnosis.table import Table
from impid_host.diagnosis.unsteady import unsteady
from impid_host.diagnosis.wander import wandering
from impid_host.signals.chain import PUBLISHED_CUTOFF_HZ
from impid_host.study.model import Study


def left_over(case: Case, active: Sequence[int], curves: Sequence[int], fit: Refit) -> list[Structure]:
    """Structure in what the effects leave: curves, hums, a random walk; or parts unlike the others."""
    table, model = case.table, [*active, *curves]
    left = structures(table, active, curves, case.looked_at)
    left += spectral_lines(table, model, case.taps)
    left += wandering(table, model, case.taps)
    return left if left else unsteady_of(case, fit)


def left_out(case: Case, pushed: Sequence[Burst]) -> list[Structure]:
    """Rows that took no part, where that says something of the study."""
    odd = list(case.oddities)
    if are_pushes(pushed, sum(float(view.t[-1]) for view in case.views)):
        odd += [Oddity(burst.trial, "tau1", 0.0, burst.words) for burst in pushed]
    return [odd_structure(oddity) for oddity in odd]


def unknown_stage(
    bench: Bench,
    table: Table,
    active: Sequence[int],
    curves: Sequence[int],
    fit: Refit,
    left: Sequence[Structure],
    before: Mapping[str, float],
) -> tuple[Stage, Refit]:
    """The last stage: the named effects' model with those curves that say something of other data.

    Args:
        before: held-out rms without the curves; where they make it worse, they say nothing of other data.
    """
    share = min(1.0, sum(row.share for row in left))
    parts = [part for part in curve_parts(table, active, curves) if carries(part)]
    unsure = least_sure(table, active, curves)
    on = [row.on for row in left]
    stage, with_curves = unattributed_stage(bench, fit, parts, on, share, unsure)
    if parts and is_worse(stage.rms, before):
        return unattributed_stage(bench, fit, [], on, share, unsure)
    return stage, with_curves


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


def floor_of(case: Case, fit: Refit, left: Sequence[Structure], study: Study) -> Floor:
    """What noise alone leaves in each held-out channel; the lines of what hums are no noise."""
    lines_Hz = [row.peak for row in left if row.variable == "frequency" and len(row.curve)]
    seconds = sum(float(np.sum(view.valid)) * view.dt for view in case.sample)
    columns = saturated(case.base, case.slots, round(5 * 2 * PUBLISHED_CUTOFF_HZ * seconds / PER_COLUMN))
    used = {view.name for view in case.views}
    logs = [(trial.robot.tau, trial.robot.force) for trial in study.trials if trial.name in used]
    steps = resolution_of(logs)
    fit = replace(fit, views=sampled(fit.views))
    return noise_floor(fit, case.base, case.holdout, case.runs, columns, lines_Hz, steps)
