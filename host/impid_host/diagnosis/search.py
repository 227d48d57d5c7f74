"""The search for the explanation that predicts best: a few side by side, named and unnamed terms alike.

From the base model on, the terms that lower the squares most are tried one at a time; those that predict
unseen blocks clearly better, by an amount that matters, with possible parameters, stay. The best few sets go
on together. At the end the simplest set that is not clearly worse than the best is chosen, a name before an
unnamed structure.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.diagnosis.rows import Key
from impid_host.diagnosis.score import Explanation, Scorer, difference
from impid_host.diagnosis.table import Table, residuals, swept
from impid_host.effects.bounds import anywhere, negligible, possible
from impid_host.effects.effect import Kind, Term, When
from impid_host.signals.arrays import Floats


@dataclass(frozen=True, slots=True)
class Rules:
    """All numbers that decide. Chosen on seeds that no reported campaign uses.

    Attributes:
        sigmas: standard errors by which a term must predict better; nats: and at least so much.
        close_sigmas, close_nats: what is within either of them is not clearly worse.
        matters: least mean square of what a term changes, over a row's noise, in a channel where it shows.
        shows: a term shows where it changes so much of what it changes in the channel where it changes most.
        relative, relative_unnamed: and over what the other terms change there: the imperfect shape of a large
            term leaves so much.
        beam: sets carried along; contenders: terms tried on each; most: terms in a set.
        takes: a name must take away so many times what is left above the noise: it halves the rms.
        constant: of what a name takes away so much may ask for other values in other trials or channels.
        likely: a name, with all that these data cannot tell from it, must be so probable; where it is so only
            together with them, the tie stays open.
    """

    sigmas: float = 3.0
    nats: float = 6.0
    close_sigmas: float = 2.0
    close_nats: float = 4.0
    matters: float = 0.1
    shows: float = 0.3
    relative: float = 0.002
    relative_unnamed: float = 0.03
    beam: int = 3
    contenders: int = 8
    most: int = 7
    takes: float = 3.0
    constant: float = 0.03
    likely: float = 0.7


RULES = Rules()
_FINER = 7
_WORTH_REFINING = 0.5  # of the best contender's score


@dataclass(frozen=True, slots=True)
class Found:
    """What a search ends with.

    Attributes:
        best: the chosen explanation, of its own slots without those given.
    """

    walk: "Walk"
    best: Explanation

    @property
    def table(self) -> Table:
        """With the finer shapes that were tried."""
        return self.walk.table

    @property
    def visited(self) -> tuple[Explanation, ...]:
        """Every set that was scored."""
        return tuple(self.walk.visited.values())


def search(table: Table, given: Sequence[int] = (), rules: Rules = RULES) -> Found:
    """Search from the base model with the `given` slots, which stay in whatever happens."""
    walk = Walk(table, tuple(given), rules)
    beam = [walk.score(())]
    for _ in range(rules.most):
        grown = [walk.simplified(new) for old in beam for new in walk.grown(old)]
        grown = [own for own in grown if walk.is_possible(own)]
        after = _distinct([*beam, *grown], walk)[: rules.beam]
        if [own.slots for own in after] == [own.slots for own in beam]:
            break
        beam = after
    best = walk.swapped(beam[0])
    return Found(walk, walk.simplest(best))


def clearly_better(one: Explanation, other: Explanation, rules: Rules = RULES) -> bool:
    """By more than chance, and by more than nothing."""
    by = difference(one, other)
    return by.gain > rules.nats and by.surely(rules.sigmas)


def not_clearly_worse(one: Explanation, best: Explanation, rules: Rules = RULES) -> bool:
    """Within chance of the best, or behind it by next to nothing."""
    by = difference(best, one)
    return by.gain < rules.close_nats or not by.surely(rules.close_sigmas)


@dataclass
class Walk:
    """One search: its table grows by finer shapes, and what was scored is remembered."""

    table: Table
    given: tuple[int, ...]
    rules: Rules

    def __post_init__(self) -> None:
        self.visited: dict[tuple[int, ...], Explanation] = {}
        self._scorer = Scorer(self.table)
        self.known_shapes: dict[tuple[int, ...], tuple[int, ...]] = {}
        self._whole: dict[Kind, Term] = {}  # of a term in some trials only: the term in all

    def score(self, slots: Sequence[int]) -> Explanation:
        """The set beside those given, scored once."""
        key = tuple(slots)
        name = tuple(sorted(key))
        if name not in self.visited:
            full = self._scorer.explanation(self.table, (*self.given, *key))
            beta = full.beta[len(self.table.columns(self.given)) :]
            self.visited[name] = replace(full, slots=key, beta=beta)
        return self.visited[name]

    def grown(self, old: Explanation) -> Iterator[Explanation]:
        """The set with each term that predicts clearly better beside it, by an amount that matters."""
        if len(old.slots) >= self.rules.most:
            return
        for s, promising in self.contenders(old).items():
            slots = self.refined((*old.slots, s)) if promising else (*old.slots, s)
            new = self.score(slots)
            if not self.is_possible(new) or not clearly_better(new, old, self.rules):
                continue
            if self.matters(slots, len(slots) - 1):
                yield new

    def simplified(self, old: Explanation) -> Explanation:
        """Without the terms that the others explain away."""
        slots = list(old.slots)
        while len(slots) > 1:
            whole = self.score(slots)
            fewer = [self.score([o for o in slots if o != s]) for s in slots]
            idle = [
                (difference(whole, less).gain, k)
                for k, less in enumerate(fewer)
                if not clearly_better(whole, less, self.rules) or not self.matters(slots, k)
            ]
            if not idle:
                break
            slots.pop(min(idle)[1])
        return self.score(slots)

    def swapped(self, best: Explanation) -> Explanation:
        """Each term replaced by another, given the others, while that predicts clearly better."""
        for place in range(len(best.slots)):
            rest = [o for k, o in enumerate(best.slots) if k != place]
            for s in [*self._partial(best.slots[place]), *self.contenders(self.score(rest))]:
                new = self.score(self.refined((*rest, s)))
                if self.is_possible(new) and new.total > best.total + self.rules.close_nats:
                    best = new
                    break
        return self.simplified(best)

    def _partial(self, s: int) -> list[int]:
        """The same effect of the machine in other trials: all, free ones only, or those under load only."""
        term = self.table.term(s)
        whole = self._whole.get(term.kind, term)
        if not anywhere(whole):
            return []
        return [self._in_trials(s, when) for when in ("all", *self.table.parts) if when != term.when]

    def _in_trials(self, s: int, when: When) -> int:
        """The slot's term at its shape in trials of one kind only, or in all."""
        slot = self.table.slots[s]
        own = self._whole.get(slot.term.kind, slot.term)
        if when == own.when:
            slots = [k for k, other in enumerate(self.table.slots) if other.term is own]
            return min(slots, key=lambda k: abs(self.table.slots[k].shape - slot.shape))
        wanted = (*own.kind[:3], when)
        if wanted not in self._whole:
            self.table = self.table.only_in(own, when)
            self._whole[wanted] = own
        same = [k for k, other in enumerate(self.table.slots) if other.term.kind == wanted]
        return min(same, key=lambda k: abs(self.table.slots[k].shape - slot.shape))

    def simplest(self, best: Explanation) -> Explanation:
        """Of all that is not clearly worse than the best, the simplest; names before unnamed structures."""
        close = [
            own
            for own in self.visited.values()
            if (not_clearly_worse(own, best, self.rules) or self._as_near(own, best))
            and self.is_possible(own)
        ]
        return min(close or [best], key=lambda own: (*self._plainness(own), -own.total))

    def _as_near(self, own: Explanation, best: Explanation) -> bool:
        """As many terms, and behind by no more than the imperfect first-order shape of large ones leaves."""
        explained = best.total - self.score(()).total
        return len(own.slots) == len(best.slots) and best.total - own.total < self.rules.relative * explained

    def _plainness(self, own: Explanation) -> tuple[int, int, int, int]:
        """Structures without a name, causes, parameters, and what is claimed of some trials only."""
        terms = [self.table.term(s) for s in own.slots]
        return (
            sum(not term.named for term in terms),
            len({term.effect for term in terms}),
            sum(term.parameters for term in terms),
            sum(term.when != "all" for term in terms),
        )

    def is_possible(self, own: Explanation) -> bool:
        """Every term has parameters within its bounds when all are fitted together."""
        return not self.impossible(own)

    def impossible(self, own: Explanation) -> list[int]:
        """The terms of the set whose parameters are out of their bounds when all are fitted together."""
        first, result = 0, []
        for s in own.slots:
            slot = self.table.slots[s]
            beta = own.beta[first : first + slot.term.size]
            # What is linear about a wrong model may be out of bounds at first; its exact refit may not.
            inside = (
                slot.term.gate(beta, slot.shape)
                if slot.term.by_model
                else possible(slot.term, beta, slot.shape)
            )
            if not inside:
                result.append(s)
            first += slot.term.size
        return result

    def matters(self, slots: Sequence[int], place: int) -> bool:
        """What the term changes is more than nobody would care about."""
        slot = self.table.slots[slots[place]]
        first = sum(self.table.term(s).size for s in slots[:place])
        beta = self.score(slots).beta[first : first + slot.term.size]
        if negligible(slot.term, beta, slot.shape):
            return False
        return size_that_matters(self.table, (*self.given, *slots), len(self.given) + place, self.rules)

    def contenders(self, old: Explanation) -> dict[int, bool]:
        """The best slot of each term, by drop of the squares less its BIC penalty, the best few.

        Returns:
            slot -> whether its score is of the size of the best one's.
        """
        taken = {_place(self.table, s) for s in (*self.given, *old.slots)}
        active = (*self.given, *old.slots)
        whens: tuple[When, ...] = ("all", *(when for when in self.table.parts if when != "all"))
        left = {when: swept(self.table, self.table.columns(active), when) for when in whens}
        penalty = np.log(max(self.table.rows, 2))
        scored: list[tuple[float, int, When]] = []
        for s, slot in enumerate(self.table.slots):
            if _place(self.table, s) in taken:
                continue
            own = whens if anywhere(slot.term) else whens[:1]
            drops = {when: left[when].drop(slot.columns) for when in own}
            # In all trials is the simpler claim.
            when = max(own, key=lambda when: drops[when] + (2 * self.rules.nats if when == "all" else 0.0))
            score = 0.5 * (drops[when] - penalty * slot.term.parameters)
            if score > 0:
                scored.append((score, s, when))
        result: dict[int, bool] = {}
        seen: set[Kind] = set()
        room = {True: self.rules.contenders, False: self.rules.contenders // 2}
        top = max(scored, default=(0.0, 0, "all"))[0]
        for score, s, when in sorted(scored, reverse=True):
            term = self.table.term(s)
            if term.kind in seen or room[term.named] == 0:
                continue
            seen.add(term.kind)
            room[term.named] -= 1
            result[s if when == "all" else self._in_trials(s, when)] = score > _WORTH_REFINING * top
        return result

    def refined(self, slots: Sequence[int]) -> tuple[int, ...]:
        """The set with its non-linear parameters improved, the new one first, one after another."""
        name = tuple(slots)
        if name in self.known_shapes:
            return self.known_shapes[name]
        result = list(slots)
        order = [len(result) - 1, *range(len(result) - 1)]
        for place in order:
            if self.table.term(result[place]).shaped:
                rest = [*self.given, *(o for k, o in enumerate(result) if k != place)]
                self.table, result[place] = refined_one(self.table, rest, result[place])
        self.known_shapes[name] = tuple(result)
        return tuple(result)


def _place(table: Table, s: int) -> tuple[str, tuple[str, ...], str]:
    """What must not be in a set twice: an effect at one place; an unnamed structure of one form."""
    term = table.term(s)
    return (term.effect, term.where, "" if term.named else term.variant)


def _distinct(found: Sequence[Explanation], walk: Walk) -> list[Explanation]:
    """Best first; of sets that differ in nothing but finer shapes the best."""
    seen: set[frozenset[Kind]] = set()
    result = []
    for own in sorted(found, key=lambda e: -e.total):
        name = frozenset(walk.table.term(s).kind for s in own.slots)
        if name not in seen:
            seen.add(name)
            result.append(own)
    return result


def refined_one(table: Table, rest: Sequence[int], s: int) -> tuple[Table, int]:
    """Two rounds of finer shapes around the best of the term's own, the rest given (variable projection)."""
    term = table.term(s)

    def best_of(table: Table) -> int:
        left = swept(table, table.columns(rest))
        own = [k for k, slot in enumerate(table.slots) if slot.term is term]
        return max(own, key=lambda k: left.drop(table.slots[k].columns))

    s = best_of(table)
    for _ in range(2):
        shapes = np.unique([slot.shape for slot in table.slots if slot.term is term])
        here = int(np.searchsorted(shapes, table.slots[s].shape))
        left, right = shapes[max(here - 1, 0)], shapes[min(here + 1, len(shapes) - 1)]
        if right - left < 1e-3 * abs(shapes[here]):
            break
        fresh = [float(v) for v in np.linspace(left, right, _FINER)[1:-1] if abs(v - shapes[here]) > 1e-12]
        if not fresh:
            break
        table = table.with_shapes(term, fresh)
        s = best_of(table)
    return table, s


def size_that_matters(table: Table, slots: Sequence[int], place: int, rules: Rules = RULES) -> bool:
    """Whether a term changes a channel by more than anybody ignores, and than larger terms leave."""
    columns = table.columns(slots)
    first = sum(table.term(s).size for s in slots[:place])
    own = np.arange(first, first + table.term(slots[place]).size)
    rest = np.delete(columns, own)
    before, after = residuals(table, rest), residuals(table, columns)
    changes: dict[Key, Floats] = {}
    for run, r0, r1 in zip(table.runs, before, after, strict=True):
        entry = changes.setdefault(run.key, np.zeros(3))
        entry += np.array([r0 @ r0 - r1 @ r1, run.target @ run.target - r0 @ r0, len(r0)])
    most = max(float(entry[0]) for entry in changes.values())
    relative = rules.relative if table.term(slots[place]).named else rules.relative_unnamed
    return any(
        entry[0] > max(rules.matters * entry[2], relative * entry[1])
        for entry in changes.values()
        if entry[0] > rules.shows * most
    )
