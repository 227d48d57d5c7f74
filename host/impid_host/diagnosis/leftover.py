"""What no row of the catalogue explains: found as curves, and told from effects that merely resemble it."""

from collections.abc import Sequence

from impid_host.diagnosis.choice import choose, pruned
from impid_host.diagnosis.dynamic import is_response
from impid_host.diagnosis.evidence import gain, projected
from impid_host.diagnosis.support import Shown, block_grams, carries_over, channels, energy, p_value
from impid_host.diagnosis.table import Table, ranking, score_of

BETTER = 0.05  # part of what the effects explain, by which a curve must do better to be believed instead
_PATCH = 0.1
_LEAST = 12.0
_CURVES = 3
_P_VALUE = 1e-3
_ROWS_EACH = 15  # of a channel, for each of a curve's parameters


def unmasked(table: Table, fixed: Sequence[int] = ()) -> tuple[Table, list[int], list[int]]:
    """The choice, after each effect had to hold its own against curves without a cause.

    Args:
        fixed: slots that are in the model whatever happens.

    Returns:
        the table, slots of the effects, slots of the curves.
    """
    table, active = choose(table, fixed)
    curves: list[int] = []
    for _ in range(_CURVES):
        curve = _next_curve(table, [*fixed, *active, *curves])
        if curve is None:
            break
        given = [*fixed, *curves, curve]
        if not active:
            curves = [*curves, curve]
            continue
        # Which effects does the curve make superfluous?
        kept = survivors(table, active, given)
        other_table, again = choose(table, given)
        now = total(table, [*fixed, *active, *curves])
        stays = total(table, [*kept, *given])
        fresh = total(other_table, [*again, *given])
        threshold = max(_LEAST, BETTER * explained(table, [*fixed, *active, *curves]))
        if max(stays, fresh) < now + threshold:
            break
        if fresh > stays + _LEAST:
            table, active = other_table, again
        else:
            active = kept
        curves = [*curves, curve]
    return table, beside_curves(table, active, curves), curves


def beside_curves(table: Table, active: Sequence[int], curves: Sequence[int]) -> list[int]:
    """Effects that are more than a patch on a curve too stiff for what it stands for."""
    if not curves:
        return list(active)
    by_curves = explained(table, [*active, *curves]) - explained(table, active)
    # A response in frequency can be half of nearly anything linear: a name beside it must be the larger part.
    dynamic = any(is_response(table.slots[s].candidate) for s in curves)
    part = 1.0 if dynamic else _PATCH
    kept = []
    for s in active:
        elsewhere = table.slots[s].candidate.effect.startswith(("accel.", "clock."))
        rest = [*(other for other in active if other != s), *curves]
        if elsewhere or _drop(table, rest, s) > part * by_curves:
            kept.append(s)
    return kept


def survivors(table: Table, active: Sequence[int], given: Sequence[int]) -> list[int]:
    """Effects that still explain at least half of what they did, once the curves are in the model."""
    kept = []
    for s in active:
        rest = [other for other in active if other != s]
        before = _drop(table, rest, s)
        after = _drop(table, [*rest, *given], s)
        if after > 0.5 * before:
            kept.append(s)
    return pruned(table, given, kept)


def total(table: Table, active: Sequence[int]) -> float:
    """Score of a whole model: drop of the RSS less the prices."""
    result = 0.0
    rest: list[int] = []
    for s in active:
        result += score_of(table, rest, s)
        rest = [*rest, s]
    return result


def explained(table: Table, active: Sequence[int]) -> float:
    """Drop of the RSS by a whole model."""
    return float(table.G[0, 0] - projected(table.G, table.columns(active))[0, 0])


def _drop(table: Table, rest: Sequence[int], s: int) -> float:
    return gain(projected(table.G, table.columns(rest)), table.G, table.slots[s].columns)


def _most_rows(shown: Sequence[Shown]) -> int:
    return max(one.rows for one in shown)


def _next_curve(table: Table, active: Sequence[int]) -> int | None:
    for score, s in ranking(table, active, known=False)[:3]:
        if score <= 0:
            return None
        if p_value(table, active, s) > _P_VALUE:
            continue
        shown = channels(table, active, s)
        if energy(shown) < 2 * 0.04 or _ROWS_EACH * table.slots[s].candidate.size > _most_rows(shown):
            continue
        if carries_over(block_grams(table, [*active, s]), table.slots[s].candidate.size):
            return s
    return None
