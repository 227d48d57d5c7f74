"""What no row of the catalogue explains: found as curves, and told from effects that merely resemble it."""

from collections.abc import Sequence

import numpy as np

from impid_host.diagnosis.choice import (
    Table,
    block_grams,
    carries_over,
    choose,
    energy,
    p_value,
    pruned,
    ranking,
    score_of,
)
from impid_host.diagnosis.evidence import gain, projected, solve
from impid_host.diagnosis.result import Structure
from impid_host.diagnosis.smooth import curve_basis, pull
from impid_host.effects.view import View
from impid_host.signals.arrays import Floats

_BETTER = 0.05  # part of what the effects explain, by which a curve must do better to be believed instead
_PATCH = 0.1
_LEAST = 12.0
_CURVES = 3
_P_VALUE = 1e-3


def unmasked(table: Table) -> tuple[Table, list[int], list[int]]:
    """The choice, after each effect had to hold its own against curves without a cause.

    Returns:
        the table, slots of the effects, slots of the curves.
    """
    table, active = choose(table)
    curves: list[int] = []
    for _ in range(_CURVES):
        curve = _next_curve(table, [*active, *curves])
        if curve is None:
            break
        given = [*curves, curve]
        if not active:
            curves = given
            continue
        # Which effects does the curve make superfluous?
        kept = survivors(table, active, given)
        other_table, again = choose(table, given)
        now = total(table, [*active, *curves])
        stays = total(table, [*kept, *given])
        fresh = total(other_table, [*again, *given])
        threshold = max(_LEAST, _BETTER * explained(table, [*active, *curves]))
        if max(stays, fresh) < now + threshold:
            break
        if fresh > stays + _LEAST:
            table, active = other_table, again
        else:
            active = kept
        curves = given
    return table, beside_curves(table, active, curves), curves


def beside_curves(table: Table, active: Sequence[int], curves: Sequence[int]) -> list[int]:
    """Effects that are more than a patch on a curve too stiff for what it stands for."""
    if not curves:
        return list(active)
    by_curves = explained(table, [*active, *curves]) - explained(table, active)
    kept = []
    for s in active:
        elsewhere = table.slots[s].candidate.effect.startswith(("accel.", "clock."))
        rest = [*(other for other in active if other != s), *curves]
        if elsewhere or _drop(table, rest, s) > _PATCH * by_curves:
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


def _next_curve(table: Table, active: Sequence[int]) -> int | None:
    for score, s in ranking(table, active, known=False)[:3]:
        if score <= 0:
            return None
        if p_value(table, active, s) > _P_VALUE or energy(table, active, s) < 2 * 0.04:
            continue
        if carries_over(block_grams(table, [*active, s]), table.slots[s].candidate.size):
            return s
    return None


def structures(
    table: Table, active: Sequence[int], curves: Sequence[int], views: Sequence[View]
) -> list[Structure]:
    """The curves as shapes that a reader can look at."""
    result = []
    beta, _ = solve(table.G, table.columns([*active, *curves]))
    columns = np.array(table.columns([*active, *curves]), dtype=int) + 1
    covariance = np.linalg.pinv(table.G[np.ix_(columns, columns)])
    first = len(table.columns(active))
    for order, s in enumerate(curves):
        slot = table.slots[s]
        size = slot.candidate.size
        own = slice(first, first + size)
        on, variable = slot.candidate.where
        if variable == "one_trial":
            share = _drop(table, [*active, *curves[:order]], s) / max(
                _own_squares(table, [*active, *curves[:order]], on), 1e-300
            )
            sentence = f"trial {slot.candidate.variant} is unlike the others"
            nothing = np.zeros((0, 2))
            result.append(Structure(variable, on, float(np.clip(share, 0, 1)), nothing, nothing, sentence))
            first += size
            continue
        if variable == "direction":
            of = slot.candidate.variant
            values = np.concatenate([pull(view, int(on[-1]) - 1, of)[view.valid] for view in views])
            grid = np.linspace(0.0, float(np.percentile(values, 99.5)), 41)
            basis = grid[:, None]
        else:
            values = np.concatenate([_values(view, variable)[view.valid] for view in views])
            low, high = np.percentile(values, [0.2, 99.8])
            grid = np.linspace(low, high, 41)
            basis = curve_basis(grid, float(low), float(high), size)
        curve = basis @ beta[own]
        half = 1.96 * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", basis, covariance[own, own], basis), 0))
        rest = [*active, *curves[:order]]
        share = _drop(table, rest, s) / max(_own_squares(table, rest, on), 1e-300)
        factor = slot.candidate.variant.split(" times ")[0] if " times " in slot.candidate.variant else ""
        result.append(
            Structure(
                variable=variable,
                on=on,
                share=float(np.clip(share, 0, 1)),
                curve=np.stack([grid, curve], axis=1),
                band=np.stack([curve - half, curve + half], axis=1),
                words=words(variable, on, grid, curve, factor, slot.candidate.variant),
            )
        )
        first += size
    return result


def words(variable: str, on: str, grid: Floats, curve: Floats, factor: str, of: str = "") -> str:
    """The curve in a sentence."""
    level = np.median(curve)
    peak = int(np.argmax(np.abs(curve - level)))
    high = np.abs(curve - level) > 0.5 * np.abs(curve[peak] - level)
    width = float(np.ptp(grid[high])) if high.any() else 0.0
    narrow = width < 0.3 * np.ptp(grid)
    if variable == "direction":
        return f"{on} has dry friction that changes by {np.ptp(curve):.2g} N m with the {of}"
    times = f", multiplied by the {factor} of motion" if factor else ""
    if narrow:
        return f"narrow bump of {on} near {variable} = {grid[peak]:.3g}, about {width:.2g} wide{times}"
    return f"{on} varies smoothly with {variable}, by {np.ptp(curve):.2g} over its range{times}"


def _values(view: View, variable: str) -> Floats:
    own: dict[str, Floats] = {
        "x": view.x[:, 0],
        "y": view.x[:, -1],
        "speed": np.linalg.norm(view.v, axis=1),
        "time": view.t,
    }
    if variable in own:
        return own[variable]
    signal = view.theta if variable.startswith("theta") else view.omega
    result: Floats = signal[:, int(variable[-1]) - 1]
    return result


def _own_squares(table: Table, active: Sequence[int], on: str) -> float:
    columns = table.columns(active)
    beta, _ = solve(table.G, columns)
    channel = int(on[-1]) - 1
    result = 0.0
    for run in table.runs:
        if run.key == ("torque", channel):
            r = run.target - run.design[:, columns] @ beta
            result += float(r @ r)
    return result
