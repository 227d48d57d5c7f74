"""The curves without a cause, as shapes that a reader can look at."""

from collections.abc import Sequence

import numpy as np

from impid_host.diagnosis.odd_shapes import ODD_MACHINE, banded, of_machine
from impid_host.diagnosis.result import Structure
from impid_host.diagnosis.rows import Slot
from impid_host.diagnosis.table import Table, residuals, solve, swept
from impid_host.effects.response import NODES_HZ, RESPONSE
from impid_host.effects.structure import EACH, course_basis, curve_basis, values_of
from impid_host.effects.view import View
from impid_host.signals.arrays import Floats

_NOTHING = np.zeros((0, 2))


def structures(
    table: Table, active: Sequence[int], curves: Sequence[int], views: Sequence[View]
) -> list[Structure]:
    """One entry for each slot of `curves`, given the effects `active`."""
    columns = table.columns([*active, *curves])
    beta, _ = solve(table.G, columns)
    place = columns + 1
    covariance = np.asarray(np.linalg.pinv(table.G[np.ix_(place, place)]), dtype=np.float64)
    first = len(table.columns(active))
    result = []
    for order, s in enumerate(curves):
        slot = table.slots[s]
        own = slice(first, first + slot.term.size)
        first = own.stop
        share = _share(table, [*active, *curves[:order]], s)
        result.append(_shape(slot, share, beta[own], covariance[own, own], views))
    return result


def _shape(slot: Slot, share: float, beta: Floats, covariance: Floats, views: Sequence[View]) -> Structure:
    on, variable = slot.term.where
    variant = slot.term.variant
    if variable == "one_trial":
        sentence = f"trial {variant} is unlike the others"
        return Structure(variable, on, share, _NOTHING, _NOTHING, sentence)
    if variant.startswith(RESPONSE):
        return _response(slot, share, beta, covariance, views)
    if variant in ODD_MACHINE:
        return of_machine(slot, share, beta, covariance, views)
    if variant.startswith(EACH):
        return _gain(on, share, beta, covariance, views)
    values = np.concatenate([values_of(view, variable)[view.valid] for view in views])
    low, high = np.percentile(values, [0.2, 99.8])
    grid = np.linspace(low, high, 41)
    basis = curve_basis(grid, float(low), float(high), len(beta))
    curve, band = banded(grid, basis, beta, covariance)
    factor = variant.split(" times ")[0] if " times " in variant else ""
    return Structure(variable, on, share, curve, band, words(variable, on, grid, curve[:, 1], factor))


def _gain(on: str, share: float, beta: Floats, covariance: Floats, views: Sequence[View]) -> Structure:
    """The gain's course in the trial in which it changes most."""
    size = len(beta) // len(views)
    spans = [float(np.ptp(beta[size * k : size * (k + 1)])) for k in range(len(views))]
    most = int(np.argmax(spans))
    own = slice(size * most, size * (most + 1))
    grid = np.linspace(0.0, float(views[most].t[-1]), 41)
    basis = course_basis(grid, size)
    curve, band = banded(grid, basis, beta[own], covariance[own, own])
    by = np.ptp(curve[:, 1])
    sentence = f"{on} changes with time as by a gain that wanders, by {by:.2g} in {views[most].name}"
    return Structure("time", on, share, curve, band, sentence)


def _response(slot: Slot, share: float, beta: Floats, covariance: Floats, views: Sequence[View]) -> Structure:
    """Root mean square of what each band of frequencies adds to the channel."""
    on = slot.term.where[0]
    found = [(view, slot.term.columns(view, 0.0)) for view in views]
    pieces = [block[view.valid] for view, blocks in found for block in blocks.values()]
    block = np.concatenate([piece.reshape(-1, len(beta)) for piece in pieces])
    frequency = np.array(NODES_HZ)
    power = block.T @ block / len(block)
    square, spread = np.zeros(len(frequency)), np.zeros(len(frequency))
    for k in range(len(beta) // 2):
        own = slice(2 * k, 2 * k + 2)
        square[k % len(frequency)] += beta[own] @ power[own, own] @ beta[own]
        spread[k % len(frequency)] += max(float(np.trace(power[own, own] @ covariance[own, own])), 0.0)
    size, half = np.sqrt(square), 1.96 * np.sqrt(spread)
    curve = np.stack([frequency, size], axis=1)
    band = np.stack([np.maximum(size - half, 0), size + half], axis=1)
    peak = frequency[int(np.argmax(size))]
    of = slot.term.variant.removeprefix(f"{RESPONSE} to ")
    sentence = f"{on} follows {of} by a response that no known effect has, strongest near {peak:.2g} Hz"
    return Structure("frequency", on, share, curve, band, sentence)


def words(variable: str, on: str, grid: Floats, curve: Floats, factor: str) -> str:
    """The curve in a sentence."""
    level = np.median(curve)
    peak = int(np.argmax(np.abs(curve - level)))
    high = np.abs(curve - level) > 0.5 * np.abs(curve[peak] - level)
    width = float(np.ptp(grid[high])) if high.any() else 0.0
    narrow = width < 0.3 * np.ptp(grid)
    times = f", multiplied by the {factor}{' of motion' if factor != 'torque' else ''}" if factor else ""
    if narrow:
        return f"narrow bump of {on} near {variable} = {grid[peak]:.3g}, about {width:.2g} wide{times}"
    return f"{on} varies smoothly with {variable}, by {np.ptp(curve):.2g} over its range{times}"


def _share(table: Table, rest: Sequence[int], s: int) -> float:
    """Part of what is left in the channel that the slot explains."""
    columns = table.columns(rest)
    less = swept(table, columns).drop(table.slots[s].columns)
    keys = {run.key for run in table.runs if run.has(table.columns([s]))}
    left = sum(
        float(r @ r) for run, r in zip(table.runs, residuals(table, columns), strict=True) if run.key in keys
    )
    return float(np.clip(less / max(left, 1e-300), 0, 1))
