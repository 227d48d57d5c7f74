"""What each record has for itself, fitted anew in it: offsets, zeros, what differs from trial to trial."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impid_host.diagnosis.base import Base
from impid_host.diagnosis.correct import corrected
from impid_host.diagnosis.parameters import parameters_of
from impid_host.diagnosis.result import Chosen, Number
from impid_host.diagnosis.reuse import belongs_to_record, matching, terms_of
from impid_host.diagnosis.rows import columns_in, decimator
from impid_host.diagnosis.saved_parts import SavedEffect
from impid_host.effects.catalogue import CATALOGUE
from impid_host.effects.effect import Ranges
from impid_host.effects.view import View
from impid_host.robot.terms import TERMS
from impid_host.signals.arrays import Floats

_ROUNDS = 3
_LEAST = 1e-9


def own_of_record(
    effects: Sequence[SavedEffect], parts: Sequence[View], base: Base, ranges: Ranges | None
) -> list[Chosen]:
    """Of the saved effects those that are the record's own, all their values zero yet."""
    tried = terms_of(parts, base, ranges)
    loads = {name for name, _ in base.loads}
    result = []
    for row in effects:
        if row.effect not in CATALOGUE or not belongs_to_record(row, loads):
            continue
        term = matching(row, tried)
        if term is not None:
            result.append(Chosen(term, row.shape, np.zeros(term.size), np.zeros((term.size, term.size))))
    return result


def refitted(
    parts: Sequence[View], base: Base, value: Floats, fixed: Sequence[Chosen], own: Sequence[Chosen]
) -> tuple[Floats, list[Chosen], list[str]]:
    """The model with the record's own fitted to its torques by least squares, everything else as it was.

    Args:
        value: robot and loads, (b,); constant torques among the robot's parameters are the record's own.
        fixed: effects that went along.

    Returns:
        value, the effects that move a torque with their values, and what was fitted, in words.
    """
    held = _constants(base)
    present = list(own)
    if not held and not present:
        return value, [], []
    for _ in range(_ROUNDS):
        blocks, target = _rows(parts, base, value, [*fixed, *present], present, held)
        size = np.linalg.norm(blocks, axis=0)
        moved = size > _LEAST * max(float(np.linalg.norm(target)), _LEAST)
        step = np.zeros(len(size))
        if moved.any():
            scaled = blocks[:, moved] / size[moved]
            step[moved] = np.linalg.lstsq(scaled, target, rcond=1e-8)[0] / size[moved]
        value = value.copy()
        value[held] += step[: len(held)]
        first, kept = len(held), []
        for part in present:
            place = slice(first, first + part.term.size)
            first += part.term.size
            if moved[place].any():
                kept.append(replace(part, beta=part.beta + step[place]))
        present = kept
        if not held and not present:
            break
    names = base.structure.parameter_names
    words = [f"{names[k]} {value[k]:.4g}" for k in held] + [_words(part) for part in present]
    return value, present, words


def _constants(base: Base) -> list[int]:
    """Places of the constant torques among the robot's parameters."""
    constant = TERMS["actuator.offset"]
    if base.bare or constant not in base.structure.terms:
        return []
    n = base.model.joints
    first = base.robot - n * (len(base.structure.terms) - base.structure.terms.index(constant))
    return list(range(first, first + n))


def _rows(
    parts: Sequence[View],
    base: Base,
    value: Floats,
    chosen: Sequence[Chosen],
    free: Sequence[Chosen],
    held: Sequence[int],
) -> tuple[Floats, Floats]:
    """What one unit of each adds to the torques, (N, k), and what the model leaves of them, (N,)."""
    blocks, targets = [], []
    for view in parts:
        clean = corrected(base.informed(view, value), chosen)
        model = base.columns(clean)["torque"]
        true = replace(clean, torque_model=model @ value)
        columns = [model[:, :, list(held)]]
        for part in free:
            found = columns_in(part.term, true, part.shape).get("torque")
            columns.append(np.zeros((*clean.tau.shape, part.term.size)) if found is None else found)
        lower = decimator(view)
        rows = view.valid[:: lower.step]
        left = lower(clean.tau - model @ value)[rows]
        block = lower(np.concatenate(columns, axis=2))[rows]
        blocks.append(block.reshape(-1, block.shape[2]))
        targets.append(left.ravel())
    return np.concatenate(blocks), np.concatenate(targets)


def _words(part: Chosen) -> str:
    told = []
    for name, number in parameters_of(part).items():
        by_name = {"": number} if isinstance(number, Number) else number
        told += [
            f"{name} {place} {np.ravel(own.value)[0]:.4g}".replace("  ", " ")
            for place, own in by_name.items()
        ]
    return f"{part.term.label}: {', '.join(told)}"
