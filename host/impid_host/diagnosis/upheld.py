"""From chosen names to stages that are upheld: fitted exactly, arbitrated, judged on the sealed part."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.diagnosis.arbitrate import Verdict, arbitrated, exactly_compared
from impid_host.diagnosis.beside import curves_beside
from impid_host.diagnosis.choice import Choice, evidence_of, ordered
from impid_host.diagnosis.judge import stretch_of, worse
from impid_host.diagnosis.leftover import resemblance
from impid_host.diagnosis.parameters import holds_zero
from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.result import Chosen, Evidence, Stage, Structure
from impid_host.diagnosis.stages import Bench, named_stages, unattributed
from impid_host.diagnosis.ties import chosen_slots
from impid_host.diagnosis.tolerance import with_tolerance
from impid_host.effects.bounds import negligible, on_its_bound, possible
from impid_host.study.model import Tolerance

_LOOSER = 10.0  # an interval so many times as wide
_NO_NAME = Evidence(0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Judged:
    """What the sealed part upholds.

    Attributes:
        stages: the first model and an effect more at each; last: the fit of the last of them.
        opened: names that a tie leaves open; resembled: names that are no cause; left: what has no name.
    """

    choice: Choice
    stages: tuple[Stage, ...]
    last: Refit
    opened: tuple[Chosen, ...]
    resembled: tuple[Chosen, ...]
    left: tuple[Structure, ...]
    verdict: Verdict


def upheld(choice: Choice, bench: Bench) -> Judged:
    """The chosen names in stages, as far as they are possible, likely, and no worse on the sealed part."""
    values = _values(choice)
    named, fit = stands(bench, values)
    fell = {s: part for s, part in values.items() if s not in named}
    choice, named, fit = exactly_compared(choice, bench, named, fit)
    verdict = arbitrated(choice, bench, dict(zip(named, fit.chosen, strict=True)), fit)
    certain = [s for s in named if s not in verdict.open_slots]
    alike = [*_resembled(choice, bench, named), *_undetermined(choice, bench, named, fell)]
    left = (*choice.left, *(words for _, words in alike))
    others = tuple(part for part, _ in alike)
    stages, last = named_stages(bench, [named[s] for s in certain], _evidence(choice, certain))
    if len(stages) > 1 and worse(stages[-1].rms, stages[0].rms, stretch_of(last.chosen)):
        left = (*left, *(_not_upheld(stage) for stage in stages[1:]))
        return Judged(choice, stages[:1], bench.plain, (), others, left, Verdict((), (), None))
    opened = tuple(named[s] for s in verdict.open_slots)
    return Judged(choice, stages, last, opened, others, left, verdict)


def _resembled(choice: Choice, bench: Bench, named: Mapping[int, Chosen]) -> list[tuple[Chosen, Structure]]:
    """Of the names that are no cause those that are there beside the others once all is fitted exactly."""
    rejected = {-1 - k: part for k, (part, _) in enumerate(choice.resembled)}
    there = stands(bench, {**named, **rejected})[0] if rejected else {}
    return [both for k, both in enumerate(choice.resembled) if -1 - k in there]


def _undetermined(
    choice: Choice, bench: Bench, named: Mapping[int, Chosen], fell: Mapping[int, Chosen]
) -> list[tuple[Chosen, Structure]]:
    """Of the names that fell those whose size alone the data leave open: something like it is there."""
    result = []
    for s, part in fell.items():
        own = bench.fit([*named.values(), part]).chosen[-1]
        if possible(own.term, own.beta, own.shape) and not negligible(own.term, own.beta, own.shape):
            alike = resemblance(choice.table, choice.named, s)
            words = f"{alike.on} resembles {own.term.label}, whose parameters these data do not determine"
            result.append((part, replace(alike, words=words)))
    return result


def _values(choice: Choice) -> dict[int, Chosen]:
    """The chosen names, the largest first, with the values of the search."""
    parts = _parts(choice)
    return {s: parts[s] for s in ordered(choice)}


def _parts(choice: Choice) -> dict[int, Chosen]:
    """Every chosen term, named or not, by its slot."""
    return dict(zip(choice.best.slots, chosen_slots(choice.table, choice.best), strict=True))


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


def with_last_stage(judged: Judged, bench: Bench) -> Judged:
    """A last stage for what has no known cause, or has several, of as much as the sealed part upholds.

    Names that a tie leaves open stand in it always; names that are no cause, and curves, as far as they serve
    prediction.
    """
    choice, left, stages = judged.choice, judged.left, judged.stages
    if not left and not judged.opened:
        return judged
    on = [row.on for row in left] or list(stages[0].rms)
    unnamed = [part for s, part in _parts(choice).items() if s in choice.unnamed]
    curves = tuple(curves_beside(bench.case, [part for part in unnamed if carries_over(part)], bench.taps))
    evidence = replace(_NO_NAME, share_of_residual=min(1.0, sum(row.share for row in left)))
    both = (*judged.resembled, *curves) if judged.resembled and curves else ()
    for more in [*(own for own in (both, judged.resembled, curves) if own), ()]:
        fit = bench.fit([*judged.last.chosen, *judged.opened, *more])
        stage = bench.stage(fit, unattributed(on, more, evidence))
        if not more or not (worse(stage.rms, stages[-1].rms) or looser(stage, stages[-1])):
            break
    return replace(judged, stages=(*stages, stage), last=fit)


def looser(stage: Stage, before: Stage) -> bool:
    """Whether what serves prediction costs the robot's or a load's numbers: it then stands for them."""
    pairs = [(stage.alpha, before.alpha)]
    pairs += [
        (own[name], before.loads[load][name])
        for load, own in stage.loads.items()
        for name in own
        if name in before.loads[load]  # a structure may bring a matrix that the load had not
    ]
    return any(
        bool(np.any(after.half > _LOOSER * np.maximum(first.half, 1e-3 * np.abs(first.value))))
        for after, first in pairs
        if after.half.shape == first.half.shape
    )


def carries_over(part: Chosen) -> bool:
    """Whether a curve can be taken out: it says something of other data, and is no dynamics like alpha."""
    return part.term.where[-1] not in ("time", "one_trial", "frequency")


def with_honest_intervals(judged: Judged, bench: Bench, tolerance: Tolerance) -> Judged:
    """The last stage with intervals that hold the tolerances of declared constants, and what a tie covers."""
    case, covering = bench.case, judged.verdict.covering
    final = with_tolerance(judged.stages[-1], judged.last, case.base, case.holdout, bench.prior, tolerance)
    if covering is not None:
        final = replace(final, alpha=covering.alpha, loads=covering.loads)
    return replace(judged, stages=(*judged.stages[:-1], final))


def _not_upheld(stage: Stage) -> Structure:
    """What is said of names that predict the sealed part worse: there is something, and this is not it."""
    assert stage.added is not None
    own = stage.added
    joints = [name for name in own.where if name.startswith("joint")]
    on = f"tau{joints[0][5:]}" if joints else max(stage.rms, key=lambda key: stage.rms[key])
    none = np.zeros((0, 2))
    words = f"something resembles {own.label}, but with it data that took no part are predicted worse"
    return Structure("time", on, own.evidence.share_of_residual, none, none, words)
