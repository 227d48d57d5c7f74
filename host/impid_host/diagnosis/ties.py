"""Effects that these data cannot tell apart, what would be reported under each, and the trial that tells."""

from dataclasses import dataclass, replace

import numpy as np

from impid_host.diagnosis.result import Chosen
from impid_host.diagnosis.score import Explanation, difference
from impid_host.diagnosis.search import RULES, Walk, not_clearly_worse
from impid_host.diagnosis.table import Table
from impid_host.effects.effect import Term

_RIVALS = 4


@dataclass(frozen=True, slots=True)
class Rivals:
    """For one name of the chosen set: slots about as good in its place, and what it holds by its equation.

    Attributes:
        se: standard error of the difference to each rival, nats.
    """

    slot: int
    others: tuple[int, ...]
    se: tuple[float, ...]
    labels: tuple[str, ...]


def rivals(walk: Walk, best: Explanation) -> list[Rivals]:
    """For each name, what else predicts not clearly worse in its place, the other terms given."""
    result = []
    for place, s in enumerate(best.slots):
        term = walk.table.term(s)
        if not term.named:
            continue
        rest = [o for k, o in enumerate(best.slots) if k != place]
        found: dict[str, tuple[int, float]] = {}
        for r in walk.contenders(walk.score(rest)):
            other = walk.table.term(r)
            # What holds the term itself among more is no rival: the rest of it lies idle.
            if (
                not other.named
                or same_thing(other, term)
                or term.label in other.holds
                or len(found) >= _RIVALS
            ):
                continue
            slots = walk.refined((*rest, r))
            new = walk.score(slots)
            if walk.is_possible(new) and not_clearly_worse(new, best, RULES):
                found.setdefault(other.label, (slots[-1], difference(best, new).se))
        labels = list(dict.fromkeys([term.label, *found, *term.holds]))
        result.append(
            Rivals(
                s, tuple(k for k, _ in found.values()), tuple(se for _, se in found.values()), tuple(labels)
            )
        )
    return result


def same_thing(one: Term, other: Term) -> bool:
    """An effect on x and the same effect on x and y are no rivals."""
    return one.effect == other.effect and bool(set(one.where) & set(other.where))


def chosen_slots(table: Table, own: Explanation) -> list[Chosen]:
    """The terms of a set with the values that the search has for them."""
    columns = table.columns(own.slots)
    G = table.G[np.ix_(columns + 1, columns + 1)]
    covariance = np.asarray(np.linalg.pinv(G, hermitian=True), dtype=np.float64)
    parts, first = [], 0
    for s in own.slots:
        slot = table.slots[s]
        block = slice(first, first + slot.term.size)
        first = block.stop
        term = slot.term if slot.term.shaped else replace(slot.term, shapes=(slot.shape,))
        parts.append(Chosen(term, slot.shape, own.beta[block], covariance[block, block]))
    return parts
