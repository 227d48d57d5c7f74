"""The choice: which effects the whitened rows support, one after another, re-checked backwards."""

from collections.abc import Sequence

import numpy as np

from impid_host.diagnosis.evidence import gain, projected
from impid_host.diagnosis.support import supported
from impid_host.diagnosis.table import Table, admissible, ranking, score_of

MAX_EFFECTS = 6
_SHORTLIST = 8
_FINER = 9


def choose(table: Table, given: Sequence[int] = ()) -> tuple[Table, list[int]]:
    """Slots of the effects that the data support, in the order in which they were found.

    Args:
        given: slots that are in the model whatever happens.

    Returns:
        the table with the refined shapes, and the slots in it, without those given.
    """
    given = list(given)
    active: list[int] = []
    tried: set[tuple[int, ...]] = set()
    while len(active) < MAX_EFFECTS:
        table, found = best(table, [*given, *active])
        if found is None or not supported(table, [*given, *active], found):
            table, found = companion(table, given, active)
        if found is None:
            break
        active = [*active, found]
        for _ in range(2):
            table, active = refined(table, given, active)
            active = pruned(table, given, swapped(table, given, active))
        if tuple(sorted(active)) in tried:
            break
        tried.add(tuple(sorted(active)))
    return table, active


def companion(table: Table, given: Sequence[int], active: Sequence[int]) -> tuple[Table, int | None]:
    """Plain dry friction beside a Stribeck friction whose speed has grown to stand for both.

    Each alone explains nearly all of the two, so that neither looks worth adding before the speed is fitted
    anew.
    """
    places = {s: table.slots[s].candidate.where for s in active if _is(table, s, "friction.stribeck")}
    for s, where in places.items():
        own = [
            k
            for k, slot in enumerate(table.slots)
            if _is(table, k, "friction.coulomb") and slot.candidate.where == where
        ]
        if not own or own[0] in active:
            continue
        rest = [*given, *(other for other in active if other != s)]
        finer, better = refined_one(table, [*rest, own[0]], s)
        if supported(finer, [*rest, better], own[0]) and admissible(finer, [*active, own[0]]):
            return finer, own[0]
    return table, None


def _is(table: Table, s: int, effect: str) -> bool:
    return table.slots[s].candidate.effect == effect


def best(table: Table, active: Sequence[int]) -> tuple[Table, int | None]:
    """The admissible slot of highest score; close contenders are compared at their best shapes."""
    contenders = _contenders(table, active)
    if not contenders:
        return table, None
    top = contenders[0][0]
    for score, s in contenders[:4]:
        if len(table.slots[s].candidate.shapes) > 1 and score > 0.6 * top:
            table, _ = refined_one(table, active, s)
    contenders = _contenders(table, active)
    return table, contenders[0][1] if contenders else None


def _contenders(table: Table, active: Sequence[int]) -> list[tuple[float, int]]:
    """The best slot of each candidate, best first."""
    seen: set[tuple[str, tuple[str, ...], str]] = set()
    result: list[tuple[float, int]] = []
    for score, s in ranking(table, active):
        candidate = table.slots[s].candidate
        key = (candidate.effect, candidate.where, candidate.variant)
        if score <= 0 or len(result) >= _SHORTLIST:
            break
        if key not in seen and admissible(table, [*active, s]):
            seen.add(key)
            result.append((score, s))
    return result


def refined(table: Table, given: Sequence[int], active: list[int]) -> tuple[Table, list[int]]:
    """Every non-linear parameter in `active` improved, one after another."""
    for place, s in enumerate(active):
        if len(table.slots[s].candidate.shapes) > 1:
            rest = [*given, *(other for other in active if other != s)]
            table, better = refined_one(table, rest, s)
            active = [*active[:place], better, *active[place + 1 :]]
    return table, active


def refined_one(table: Table, rest: Sequence[int], s: int) -> tuple[Table, int]:
    """Two rounds of finer shapes around the slot's own, the rest of the model given (variable projection)."""
    candidate = table.slots[s].candidate
    P = projected(table.G, table.columns(rest))
    own = [k for k, slot in enumerate(table.slots) if slot.candidate is candidate]
    s = max(own, key=lambda k: gain(P, table.G, table.slots[k].columns))
    for _ in range(2):
        own = [k for k, slot in enumerate(table.slots) if slot.candidate is candidate]
        shapes = np.unique([table.slots[k].shape for k in own])
        here = int(np.searchsorted(shapes, table.slots[s].shape))
        left, right = shapes[max(here - 1, 0)], shapes[min(here + 1, len(shapes) - 1)]
        if right - left < 1e-4 * abs(shapes[here]):
            break
        fresh = np.linspace(left, right, _FINER)[1:-1]
        table = table.with_shapes(candidate, [float(v) for v in fresh if abs(v - shapes[here]) > 1e-12])
        P = projected(table.G, table.columns(rest))
        own = [k for k, slot in enumerate(table.slots) if slot.candidate is candidate]
        s = max(own, key=lambda k: gain(P, table.G, table.slots[k].columns))
    return table, s


def pruned(table: Table, given: Sequence[int], active: list[int]) -> list[int]:
    """Without the effects that the others explain away."""
    for s in list(active):
        rest = [other for other in active if other != s]
        if rest and not supported(table, [*given, *rest], s):
            active = rest
    return active


def swapped(table: Table, given: Sequence[int], active: list[int]) -> list[int]:
    """Each effect replaced by a better one, given the others, while that helps."""
    for _ in range(2):
        for place, s in enumerate(active):
            rest = [*given, *(other for other in active if other != s)]
            own = score_of(table, rest, s)
            better = next(
                (
                    other
                    for score, other in ranking(table, rest)[:10]
                    if score > own + 2.0 and admissible(table, [*rest, other])
                ),
                None,
            )
            if better is not None:
                active = [*active[:place], better, *active[place + 1 :]]
    return active
