"""All parameters of the chosen terms as one vector, and back; and what is reported of each."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from impid_host.diagnosis.result import Chosen, Number, Reported, as_array
from impid_host.effects.catalogue import CATALOGUE
from impid_host.effects.effect import Plain
from impid_host.signals.arrays import Floats
from impid_host.signals.quantiles import NORMAL_975


def fits_shape(part: Chosen) -> bool:
    """Whether the last fit may change the non-linear parameter."""
    return part.term.shaped and not part.term.fine


def count_of(part: Chosen) -> int:
    """How many parameters of the part a fit is free to choose."""
    return len(part.beta) + fits_shape(part)


def vector_of(chosen: Sequence[Chosen]) -> Floats:
    """All parameters: of each part the linear ones, then its shape where that is fitted."""
    values: list[float] = []
    for part in chosen:
        values += part.beta.tolist()
        values += [part.shape] if fits_shape(part) else []
    return np.array(values)


def at(chosen: Sequence[Chosen], vector: Floats) -> tuple[Chosen, ...]:
    """The parts with the parameters of `vector`."""
    result, first = [], 0
    for part in chosen:
        own = vector[first : first + count_of(part)]
        first += count_of(part)
        size = len(part.beta)
        result.append(
            replace(part, beta=own[:size], shape=float(own[size]) if fits_shape(part) else part.shape)
        )
    return tuple(result)


def parted(covariance: Floats, chosen: Sequence[Chosen]) -> tuple[Chosen, ...]:
    """The parts, each with its block of the joint covariance."""
    result, first = [], 0
    for part in chosen:
        own = slice(first, first + count_of(part))
        first += count_of(part)
        result.append(replace(part, covariance=covariance[own, own]))
    return tuple(result)


def parameters_of(part: Chosen) -> dict[str, Reported]:
    """Reported parameters with intervals by linear propagation; of each trial or load with its own."""
    flat = _flat(part, part.beta, part.shape)
    # Values that were fitted anew with the shape held have no covariance of it.
    free = min(count_of(part), len(part.covariance))
    at_ = np.append(part.beta, part.shape)[:free]
    covariance = part.covariance[:free, :free]
    sd = np.sqrt(np.maximum(np.diag(covariance), 0))
    slopes: dict[tuple[str, str], list[Floats]] = {name: [] for name in flat}
    for k in range(free):
        step = np.zeros(free)
        step[k] = max(1e-3 * sd[k], 1e-9 * abs(at_[k]), 1e-15)
        moved = at_ + step
        size = len(part.beta)
        other = _flat(part, moved[:size], float(moved[size]) if free > size else part.shape)
        for entry, own in flat.items():
            slopes[entry].append((as_array(other[entry]) - as_array(own)) / step[k])
    result: dict[str, Reported] = {}
    for (name, place), own in flat.items():
        number = _number(as_array(own), np.stack(slopes[name, place], axis=-1), covariance, _unit(part, name))
        if place:
            result.setdefault(name, {})[place] = number  # type: ignore[index]
        else:
            result[name] = number
    return result


def _flat(part: Chosen, beta: Floats, shape: float) -> dict[tuple[str, str], Plain]:
    """Value by name and by trial or load, "" where it is of all."""
    result: dict[tuple[str, str], Plain] = {}
    for name, value in part.term.read(beta, shape).items():
        for place, own in value.items() if isinstance(value, dict) else (("", value),):
            result[name, place] = own
    return result


def _number(value: Floats, slope: Floats, covariance: Floats, unit: str) -> Number:
    variance = np.einsum("...i,ij,...j->...", slope, covariance, slope)
    half = NORMAL_975 * np.sqrt(np.maximum(variance, 0))
    return Number(value, np.stack([value - half, value + half], axis=-1), unit)


def _unit(part: Chosen, name: str) -> str:
    return part.term.units.get(name) or CATALOGUE[part.term.effect].unit(name)


def joined(values: Sequence[Mapping[str, Reported]]) -> dict[str, Reported]:
    """One part's numbers, or a value for each part."""
    if len(values) == 1:
        return dict(values[0])
    return {name: _beside([own[name] for own in values]) for name in values[0]}


def _beside(several: Sequence[Reported]) -> Reported:
    numbers = [own for own in several if isinstance(own, Number)]
    if len(numbers) < len(several):
        maps = [own for own in several if not isinstance(own, Number)]
        return {name: _stacked([own[name] for own in maps]) for name in maps[0]}
    return _stacked(numbers)


def _stacked(numbers: Sequence[Number]) -> Number:
    return Number(
        np.stack([own.value for own in numbers]), np.stack([own.ci95 for own in numbers]), numbers[0].unit
    )


def holds_zero(part: Chosen) -> bool:
    """Whether an amplitude's interval holds zero, so that the effect may as well not be there."""
    amplitudes = {row.name for row in CATALOGUE[part.term.effect].parameters if row.amplitude}
    return any(
        np.any((own.ci95[..., 0] < 0) & (own.ci95[..., 1] > 0))
        for name, own in parameters_of(part).items()
        if name in amplitudes and isinstance(own, Number)
    )
