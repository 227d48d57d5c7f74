"""Whether a term's parameters are possible: the catalogue's bounds, and what the term itself rules out."""

from collections.abc import Iterator

import numpy as np

from impid_host.effects.catalogue import CATALOGUE
from impid_host.effects.effect import Term, Value
from impid_host.signals.arrays import Floats

_NEAR = 0.02  # of a non-linear parameter: as near to a bound it is the bound's, not the data's


def possible(term: Term, beta: Floats, shape: float) -> bool:
    """Every reported parameter within its bounds, and the term's own gate open."""
    return bool(np.all(np.isfinite(beta))) and term.gate(beta, shape) and not outside(term, beta, shape)


def on_its_bound(term: Term, beta: Floats, shape: float) -> bool:
    """Whether the non-linear parameter lies where it would next be impossible: the data ask for more."""
    near = (shape * (1 + _NEAR), shape / (1 + _NEAR))
    return term.shaped and possible(term, beta, shape) and not all(possible(term, beta, s) for s in near)


def outside(term: Term, beta: Floats, shape: float) -> list[str]:
    """Names of the reported parameters beyond their bounds."""
    if term.effect not in CATALOGUE:
        return []
    rows = {row.name: row for row in CATALOGUE[term.effect].parameters}
    with np.errstate(divide="ignore", invalid="ignore"):
        found = term.read(beta, shape)
    return [
        name
        for name, value in found.items()
        if name in rows and not all(rows[name].low <= v <= rows[name].high for v in numbers(value))
    ]


def negligible(term: Term, beta: Floats, shape: float) -> bool:
    """Whether every parameter that has a region of practical equivalence lies in it."""
    rows = {row.name: row for row in CATALOGUE[term.effect].parameters} if term.named else {}
    found = term.read(beta, shape)
    sized = [(rows[name], value) for name, value in found.items() if name in rows and rows[name].least > 0]
    return bool(sized) and all(abs(v - row.none) < row.least for row, value in sized for v in numbers(value))


def anywhere(term: Term) -> bool:
    """A named effect of no load, with one value for all trials, that may be there in some of them only."""
    return term.named and CATALOGUE[term.effect].acts_on != "load" and not term.own and term.when == "all"


def numbers(value: Value) -> Iterator[float]:
    """Every number of a reported value."""
    for own in value.values() if isinstance(value, dict) else [value]:
        yield from (float(v) for v in np.ravel(own))
