"""The choice in rounds: under a second noise model, with the largest effect taken out, on held-out data."""

from collections.abc import Sequence
from dataclasses import replace

from impid_host.diagnosis.bursts import Burst, bursts
from impid_host.diagnosis.case import Case, evaluated, informed, whitened_table
from impid_host.diagnosis.choice import pruned
from impid_host.diagnosis.final_look import carried
from impid_host.diagnosis.findings import findings_of
from impid_host.diagnosis.leftover import BETTER, explained, unmasked
from impid_host.diagnosis.proof import corrected
from impid_host.diagnosis.refit import refit
from impid_host.diagnosis.rows import Run, Slot, Taps, build_runs
from impid_host.diagnosis.support import supported
from impid_host.diagnosis.table import Table, possible, score_of
from impid_host.diagnosis.ties import decomposed, joints_of
from impid_host.diagnosis.whiten import noise_models, whitened
from impid_host.effects.effect import no_gate

_LARGE = 1.0  # an effect that lowers the mean squared innovation by so many times the noise's


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


def second_opinion(case: Case, picked: Sequence[Slot]) -> tuple[Table, Taps]:
    """The table under a noise model of what the picked slots leave; they stand last in it."""
    raw, first, _ = own_runs(case, picked)
    taps = noise_models(raw, range(first), {})
    table = whitened_table(case.looked_at, case.base, case.holdout, case.slots, case.runs, taps)
    for slot in picked:
        table = table.with_shapes(slot.candidate, [slot.shape])
    return table, taps


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
    return replace(case, table=table), beside(table, largest, places[: len(fresh)], bent_places), bent_places


def beside(table: Table, largest: Sequence[int], others: Sequence[int], curves: Sequence[int]) -> list[int]:
    """The largest effect's slots, and of the others those that leave all physically possible.

    What the largest effect holds by its equation (unequal friction a constant torque) is no second effect.
    """
    candidates = [table.slots[s].candidate for s in largest]
    held = {label for own in candidates for label in decomposed(own, joints_of(table))}
    kept = possible(table, largest, curves)
    for s in others:
        if table.slots[s].candidate.label not in held and possible(table, [*kept, s], curves) == [*kept, s]:
            kept = [*kept, s]
    return kept


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
