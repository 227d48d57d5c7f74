"""Parameters of effects beside the bounds that their row of the catalogue declares."""

from collections.abc import Iterable, Iterator

import numpy as np

from impid_host.checks.gate import Bounded
from impid_host.diagnosis.parameters import parameters_of
from impid_host.diagnosis.result import Chosen, Number
from impid_host.effects.catalogue import CATALOGUE


def bounded(effects: Iterable[Chosen]) -> Iterator[Bounded]:
    """Every reported number of named effects that has a bound."""
    for part in effects:
        if not part.term.named:
            continue
        rows = {row.name: row for row in CATALOGUE[part.term.effect].parameters}
        for name, reported in parameters_of(part).items():
            row = rows.get(name)
            if row is None or not (np.isfinite(row.low) or np.isfinite(row.high)):
                continue
            numbers = {"": reported} if isinstance(reported, Number) else reported
            for place, number in numbers.items():
                for value, (low, high) in zip(
                    np.ravel(number.value), number.ci95.reshape(-1, 2).tolist(), strict=True
                ):
                    where = "+".join((*part.term.where, *([place] if place else [])))
                    said = f"{part.term.effect}: {name}"
                    yield Bounded(said, where, float(value), (low, high), row.low, row.high)
