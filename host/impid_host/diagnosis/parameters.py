"""All parameters of the chosen effects as one vector, and back."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impid_host.diagnosis.result import Chosen
from impid_host.signals.arrays import Floats

_LARGER = 5.0  # the fine parameter may exceed its first guesses by this factor
_SMALLER = 1e-4
_FINE_MOVE = 0.4  # of the log of a fine parameter: where it hardly matters, its interval knows no end


def has_shape(part: Chosen) -> bool:
    """Whether the part's candidate has a non-linear parameter."""
    return len(part.candidate.shapes) > 1


def count_of(part: Chosen) -> int:
    """How many parameters of the part a fit is free to choose."""
    return len(part.beta) + has_shape(part) + (part.fine is not None)


def vector_of(chosen: Sequence[Chosen]) -> Floats:
    """All parameters: of each part the linear ones, its shape where it has one, the log of its fine one."""
    values: list[float] = []
    for part in chosen:
        values += part.beta.tolist()
        values += [part.shape] if has_shape(part) else []
        values += [] if part.fine is None else [float(np.log(part.fine))]
    return np.array(values)


def at(chosen: Sequence[Chosen], vector: Floats) -> tuple[Chosen, ...]:
    """The parts with the parameters of `vector`."""
    result, first = [], 0
    for part in chosen:
        own = vector[first : first + count_of(part)]
        first += count_of(part)
        size = len(part.beta)
        shape = float(own[size]) if has_shape(part) else part.shape
        moved = replace(part, beta=own[:size], shape=shape)
        result.append(moved if part.fine is None else with_fine(moved, float(np.exp(own[-1]))))
    return tuple(result)


def with_fine(part: Chosen, value: float) -> Chosen:
    """The part with its fine parameter, within bounds."""
    assert part.candidate.finer is not None
    fines = part.candidate.fines
    value = float(np.clip(value, min(fines) * _SMALLER, max(fines) * _LARGER))
    return replace(part, candidate=part.candidate.finer(value), fine=value)


def parted(covariance: Floats, chosen: Sequence[Chosen]) -> tuple[Chosen, ...]:
    """The parts, each with its block of the joint covariance."""
    result, first = [], 0
    for part in chosen:
        own = slice(first, first + count_of(part))
        first += count_of(part)
        result.append(replace(part, covariance=covariance[own, own]))
    return tuple(result)


def moves(chosen: Sequence[Chosen], sd: Floats) -> Floats:
    """For each parameter a move that is about a standard deviation, (k,), yet no leap."""
    result = np.maximum(sd, np.maximum(1e-9 * np.abs(vector_of(chosen)), 1e-15))
    last = -1
    for part in chosen:
        last += count_of(part)
        if part.fine is not None:
            result[last] = min(result[last], _FINE_MOVE)
    return result
