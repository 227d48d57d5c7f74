"""The choice: a search, again without events, again with large effects taken out exactly; then adequacy."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from impid_host.diagnosis.adequacy import believable, excess
from impid_host.diagnosis.case import Case, Progress, informed, silent, tabulated
from impid_host.diagnosis.confidence import confidence_of
from impid_host.diagnosis.constancy import constancies
from impid_host.diagnosis.correct import corrected
from impid_host.diagnosis.events import Event, events
from impid_host.diagnosis.leftover import changes, left_over, resemblance
from impid_host.diagnosis.refit import Refit, refit
from impid_host.diagnosis.result import Chosen, Evidence, Rival, Structure
from impid_host.diagnosis.score import Explanation, difference
from impid_host.diagnosis.search import Found, Walk, search
from impid_host.diagnosis.table import Table, residuals, swept
from impid_host.diagnosis.ties import chosen_slots, rivals
from impid_host.effects.effect import Kind, Term, no_gate

_MARGIN_S = 1.0  # left out around an event
_LARGE = 1.0  # an effect that lowers a channel's mean squared innovation by so many times the noise's
_AGAIN = 2
_BELOW = -0.25  # of the noise's mean square in the band: less is left only if the noise was overestimated


@dataclass(frozen=True, slots=True)
class Choice:
    """What was chosen.

    Attributes:
        case: without the events in its fit part.
        best: the set, of the walk's table; named, unnamed: its slots.
        left: what has no name; pushed: stretches that the fit part does without.
        resembled: names beside which too much is left, or that are not likely, with their values and what is
            said of them: they may serve prediction, and are no cause.
    """

    case: Case
    walk: Walk
    best: Explanation
    named: tuple[int, ...]
    unnamed: tuple[int, ...]
    left: tuple[Structure, ...]
    pushed: tuple[Event, ...]
    resembled: tuple[tuple[Chosen, Structure], ...] = ()

    @property
    def table(self) -> Table:
        """Rows and columns of the search."""
        return self.walk.table


def chosen(case: Case, progress: Progress = silent) -> Choice:
    """The explanation that the fit part supports."""
    table = tabulated(case, progress=progress)
    progress("searching", 0.7)
    found = search(table)
    pushed = events(
        found.table.runs, residuals(found.table, found.table.columns(found.best.slots)), case.views
    )
    if pushed:
        progress("searching again without what stands out", 0.75)
        out = tuple((e.trial, e.begin_s - _MARGIN_S, e.end_s + _MARGIN_S) for e in pushed)
        holdout = replace(case.holdout, left_out=out)
        case = replace(case, holdout=holdout)
        case = replace(case, views=tuple(informed(case.views, case.base, holdout)))
        found = search(tabulated(case))
    found = _sharpened(case, _above_its_noise(case, found))
    return _adequate(case, found, tuple(pushed))


def _above_its_noise(case: Case, found: Found) -> Found:
    """The search once more, where the first took what it then found for noise.

    An effect that the saturated regression does not hold at its own shape is noise until it has been found:
    what is left beside it is then less than the noise, and anything small looks as if it belonged there.
    """
    named = [s for s in found.best.slots if found.table.term(s).named]
    left = excess(found.table, named, case.views[0].report_hz)
    if not named or min(left.values(), default=0.0) > _BELOW:
        return found
    noise = tabulated(_without(case, found, named)[1]).noise
    return search(tabulated(case, noise))


def _without(case: Case, found: Found, slots: Sequence[int]) -> tuple[Refit, Case]:
    """Some of the best set refitted, and the study as it would be without them."""
    parts = zip(chosen_slots(found.table, found.best), found.best.slots, strict=True)
    fit = refit(case, [part for part, s in parts if s in slots], found.table.noise.taps)
    views = informed([corrected(v, fit.chosen) for v in fit.views], case.base, case.holdout)
    return fit, replace(case, views=tuple(views))


def _sharpened(case: Case, found: Found) -> Found:
    """The search once more, with large effects taken out of the signals themselves.

    What the linearised columns of an effect many times the noise leave over looks like other, smaller ones.
    """
    for _ in range(_AGAIN):
        large = [s for s in found.best.slots if _is_large(found, s)]
        if not large or len(found.best.slots) < 2:
            return found
        fit, cleaned = _without(case, found, large)
        table, given = tabulated(cleaned, found.table.noise), []
        for part in fit.chosen:
            # What is left to the effect once it is taken out is a small correction, of either sign.
            table = table.with_shapes(_ungated(part.term), [part.shape])
            given.append(len(table.slots) - 1)
        again = search(table, given)
        slots = [*fit.chosen, *chosen_slots(again.table, again.best)]
        merged = _in_table(found, slots)
        if _names(found.walk, merged.best) == _names(found.walk, found.best):
            return merged
        found = merged
    return found


def _ungated(term: Term) -> Term:
    return replace(term, gate=no_gate)


def _is_large(found: Found, s: int) -> bool:
    table = found.table
    rest = table.columns([o for o in found.best.slots if o != s])
    per_channel = table.rows / max(len({run.key for run in table.runs}), 1)
    return table.term(s).named and swept(table, rest).drop(table.slots[s].columns) > _LARGE * per_channel


def _in_table(found: Found, parts: Sequence[Chosen]) -> Found:
    """The set with these parts at their shapes, in the table of the first search."""
    walk, slots = found.walk, []
    for part in parts:
        known = [
            k
            for k, slot in enumerate(walk.table.slots)
            if slot.term.kind == part.term.kind and abs(slot.shape - part.shape) <= 1e-3 * abs(part.shape)
        ]
        if not known:
            walk.table = walk.table.with_shapes(part.term, [part.shape])
            known = [len(walk.table.slots) - 1]
        slots.append(known[0])
    return Found(walk, walk.score(tuple(slots)))


def _names(walk: Walk, own: Explanation) -> frozenset[Kind]:
    return frozenset(walk.table.term(s).kind for s in own.slots)


def _adequate(case: Case, found: Found, pushed: tuple[Event, ...]) -> Choice:
    """The names that are more than what the rest resembles; the others are looked at again as structure."""
    walk, best = found.walk, found.best
    table = walk.table
    named = [s for s in best.slots if table.term(s).named]
    unnamed = [s for s in best.slots if not table.term(s).named]
    kept, varying = _borne_out(walk, best, case.views[0].report_hz)
    values = dict(zip(best.slots, chosen_slots(table, best), strict=True))
    rejected = [s for s in named if s not in kept]
    resembled = tuple((values[s], resemblance(table, named, s, constant=s not in varying)) for s in rejected)
    if rejected:
        best = walk.score(tuple(s for s in best.slots if s in kept or s in unnamed))
        unnamed = [s for s in best.slots if not table.term(s).named]
    left = left_over(table, kept, unnamed, case.fit_views)
    return Choice(case, walk, best, tuple(kept), tuple(unnamed), left, pushed, resembled)


def _borne_out(walk: Walk, best: Explanation, report_hz: float) -> tuple[list[int], set[int]]:
    """The names that are likely, possible, constant, and more than what they leave; and those not constant.

    What falls leaves the others with what it took up, so that they are asked again.
    """
    table, varying = walk.table, set[int]()
    kept = [s for s in best.slots if table.term(s).named]
    unnamed = [s for s in best.slots if not table.term(s).named]
    # Of what these data cannot tell apart one may be right although none is likely by itself.
    groups = {own.slot: (own.slot, *own.others) for own in rivals(walk, best)}
    while True:
        everything = [*kept, *unnamed]
        asked = constancies(table, everything, kept)
        varying |= {s for s in kept if asked[s].varies > walk.rules.constant}
        wrong = varying.union(walk.impossible(walk.score(everything)))
        likely = [s for s in kept if asked[s].trust * probability(walk, groups[s]) > walk.rules.likely]
        stand = believable(table, [s for s in likely if s not in wrong], report_hz)
        if stand == kept:
            return kept, varying
        kept = stand


def probability(walk: Walk, slots: Sequence[int]) -> float:
    """That one of these names is right; what holds a name among more says nothing against it."""
    labels = {walk.table.term(s).label for s in slots}
    places = {
        slot.term.kind[:2]
        for slot in walk.table.slots
        if slot.term.label in labels or labels & set(slot.term.holds)
    }
    return confidence_of(walk.table, places, list(walk.visited.values()))


def ordered(choice: Choice) -> list[int]:
    """Named slots, the one that explains most first."""
    everything = [*choice.named, *choice.unnamed]
    size = {s: sum(changes(choice.table, everything, s).values()) for s in choice.named}
    return sorted(choice.named, key=lambda s: -size[s])


def evidence_of(choice: Choice, before: Sequence[int], s: int) -> Evidence:
    """Of a named slot of the chosen set.

    Args:
        before: slots that were in the model before it.
    """
    table, walk = choice.table, choice.walk
    columns = table.columns(before)
    open_part = swept(table, columns)
    above = max(open_part.left - table.rows, 1.0)
    less = open_part.drop(table.slots[s].columns)
    rest = walk.score(tuple(o for o in choice.best.slots if o != s))
    by = difference(choice.best, rest)
    return Evidence(
        share_of_residual=float(min(1.0, less / max(above, less, 1e-300))),
        gain=by.gain,
        gain_se=by.se,
        confidence=constancies(table, choice.best.slots, [s])[s].trust * probability(walk, [s]),
        runner_up=_runner_up(choice, s),
    )


def _runner_up(choice: Choice, s: int) -> Rival | None:
    """The best set without the name; its first term that the chosen set does not have."""
    table = choice.table
    term = table.term(s)
    mine = {(table.term(o).effect, table.term(o).where) for o in choice.best.slots}
    for own in sorted(choice.walk.visited.values(), key=lambda e: -e.total):
        labels = [(table.term(o).effect, table.term(o).where) for o in own.slots]
        if (term.effect, term.where) in labels:
            continue
        others = [label for label in labels if label not in mine]
        if others:
            return Rival(*others[0], margin=choice.best.total - own.total)
    return None
