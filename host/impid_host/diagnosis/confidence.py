"""How sure a name is, from how well all explanations that were scored predict.

Weights by the Bayesian bootstrap over blocks (pseudo-BMA+: Yao, Vehtari, Simpson and Gelman, Bayesian
Analysis 13, 2018), flattened. The flattening was set by hand on a few simulated laboratories; how often names
were right by what it says, there and on machines unlike them, stands in docs/validation/diagnosis.md and
docs/validation/independent.md.
"""

from collections.abc import Sequence, Set

import numpy as np

from impid_host.diagnosis.score import Explanation, shares
from impid_host.diagnosis.table import Table

Place = tuple[str, tuple[str, ...]]

# A logistic map of the weights' log-odds.
_LEVEL, _SLOPE = 1.6, 0.6
_SUREST = 0.98


def weights(explanations: Sequence[Explanation]) -> np.ndarray:
    """Weight of each explanation, (E,), summing to 1."""
    density = np.stack([own.density for own in explanations])
    fixed = np.array([own.reference for own in explanations])
    totals = shares(density.shape[1]) @ density.T + fixed
    totals -= totals.max(axis=1, keepdims=True)
    each = np.exp(totals)
    return np.asarray((each / each.sum(axis=1, keepdims=True)).mean(axis=0))


def confidence_of(table: Table, any_of: Set[Place], visited: Sequence[Explanation]) -> float:
    """That one of these effects at its place is right, there or at more places, 0..1.

    Args:
        visited: everything that was scored; of sets that differ in finer shapes alone the best counts.
    """
    best: dict[frozenset[Place], Explanation] = {}
    for own in visited:
        name = frozenset(table.term(s).kind[:2] for s in own.slots)
        if name not in best or own.total > best[name].total:
            best[name] = own
    weight = weights(list(best.values()))
    share = float(
        sum(w for w, name in zip(weight, best, strict=True) if any(_holds(name, p) for p in any_of))
    )
    share = float(np.clip(share, 1e-6, 1 - 1e-6))
    odds = _LEVEL + _SLOPE * np.log(share / (1 - share))
    return float(min(1 / (1 + np.exp(-odds)), _SUREST))


def _holds(name: Set[Place], place: Place) -> bool:
    """Whether a set of effects has this one at all of its places, by one term or several."""
    effect, where = place
    return set(where) <= {own for other, its in name if other == effect for own in its}
