"""The whitened rows of a study with every term's columns: sums of squares of nested and rival models.

Sums over all rows come from one Gram matrix, blocks of two seconds from their own, made for the few columns
that are asked for. Nothing here knows what a column means.
"""

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from impid_host.diagnosis.noise import BLOCK_S, Noise
from impid_host.diagnosis.rows import Index, Key, Run, Slot, slots_of
from impid_host.effects.effect import Term, When
from impid_host.signals.arrays import Floats

_RIDGE = 1e-11
_SPANNED = 1e-7  # of a column's own power: less is rounding, and the model has it already
_SPARE = 160  # columns
Maker = Callable[[Sequence[Slot]], list[Run]]
Columns = tuple[Index, NDArray[np.float32]]


@dataclass(frozen=True, slots=True)
class Units:
    """Blocks of BLOCK_S of one channel of one trial, U of them.

    Attributes:
        block: number of the block of time to which each belongs, (U,); rows: how many, (U,); key: of its
            channel.
        near: for each block, which blocks are itself or next to it in its trial, (B, B).
        edges: for each run, where its units begin and end, and their numbers.
    """

    block: Index
    rows: Floats
    key: tuple[Key, ...]
    near: Floats
    edges: tuple[tuple[Index, Index], ...]

    @property
    def blocks(self) -> int:
        """How many blocks of time, B."""
        return len(self.near)


@dataclass(slots=True)
class Room:
    """A Gram matrix with room for further columns behind it, so that one by one they need no copy of it.

    Attributes:
        filled: how many rows and columns some table has put there; no table changes what another has put.
    """

    whole: Floats
    filled: int

    @classmethod
    def of(cls, size: int) -> "Room":
        """Zeros, (size, size) of them to be filled."""
        room = size + max(_SPARE, size // 2)  # memory that nobody writes to is none
        return cls(np.zeros((room, room)), size)

    def grown(self, G: Floats, size: int) -> "tuple[Floats, Room]":
        """G within (size, size), zeros beyond it."""
        room = self
        if len(G) != self.filled or size > len(self.whole):
            room = Room.of(size)
            room.whole[: len(G), : len(G)] = G
        room.filled = size
        return room.whole[:size, :size], room


@dataclass(frozen=True, slots=True)
class Part:
    """Sums over the trials of one kind alone: what a term would do that acts in no other.

    Attributes:
        sums: products of [target | columns of the slots], with the base model in them, (1 + K, 1 + K).
        onto: products of the base's directions with them, (P, 1 + K).
    """

    sums: Floats
    onto: Floats
    room: Room = field(repr=False)


@dataclass(frozen=True, slots=True)
class Table:
    """Whitened rows of the fit part.

    Attributes:
        runs: target without the base model's part; base: orthonormal directions over all rows. References
            (weighed payloads, an earlier robot) come last.
        G: Gram matrix of [target | columns of the slots] with the base model regressed out, (1 + K, 1 + K).
        slots: terms at their shapes.
        make: whitened runs of further slots on the same rows.
        room: where G lies.
        loaded: trials under load, where there are others beside them; empty where all are alike.
        parts: sums over free and over loaded trials, or over "all" where they are alike.
    """

    runs: tuple[Run, ...]
    G: Floats
    slots: tuple[Slot, ...]
    units: Units
    noise: Noise
    make: Maker = field(repr=False)
    room: Room = field(repr=False)
    loaded: Set[str]
    parts: Mapping[When, Part] = field(repr=False)

    @property
    def rows(self) -> int:
        """How many rows."""
        return sum(len(run.target) for run in self.runs)

    def columns(self, slots: Sequence[int]) -> Index:
        """Columns of the given slots, in their order."""
        parts = [np.arange(self.slots[s].columns.start, self.slots[s].columns.stop) for s in slots]
        return np.concatenate(parts) if parts else np.zeros(0, dtype=np.intp)

    def term(self, slot: int) -> Term:
        """The slot's term."""
        return self.slots[slot].term

    def with_shapes(self, term: Term, shapes: Sequence[float]) -> "Table":
        """The table with the term's columns at further shapes behind the others."""
        fresh = self._behind(replace(term, shapes=tuple(shapes)), term)
        made = self.make(fresh)
        return self._with_columns(fresh, [(new.used, new.design) for new in made])

    def only_in(self, term: Term, when: When) -> "Table":
        """The table with the term at all its shapes again behind the others, in trials of one kind only."""
        own = [slot for slot in self.slots if slot.term is term]
        fresh = self._behind(
            replace(term, shapes=tuple(slot.shape for slot in own)), replace(term, when=when)
        )
        wanted = np.concatenate([np.arange(slot.columns.start, slot.columns.stop) for slot in own])
        places = np.arange(fresh[0].columns.start, fresh[-1].columns.stop)
        none = (places[:0], np.zeros((0, 0), dtype=np.float32))
        made = [
            (places, run.columns(wanted).astype(np.float32))
            if when_of(run.trial, self.loaded) == when and run.has(wanted)
            else (none[0], np.zeros((len(run.target), 0), dtype=np.float32))
            for run in self.runs
        ]
        return self._with_columns(fresh, made)

    def _behind(self, shaped: Term, term: Term) -> list[Slot]:
        return [replace(slot, term=term) for slot in slots_of([shaped], len(self.G) - 1)]

    def _with_columns(self, fresh: Sequence[Slot], made: Sequence[Columns]) -> "Table":
        first, last = len(self.G), 1 + fresh[-1].columns.stop
        added = np.arange(first, last)
        fields: dict[When, tuple[Floats, Floats, Room]] = {}
        for when, part in self.parts.items():
            sums, room = part.room.grown(part.sums, last)
            onto = np.concatenate([part.onto, np.zeros((len(part.onto), last - first))], axis=1)
            fields[when] = (sums, onto, room)
        runs = []
        for run, new in zip(self.runs, made, strict=True):
            runs.append(run.with_columns(*new))
            if len(new[0]) == 0:
                continue
            own = replace(run, used=new[0], design=new[1], further=()).columns(added - 1)
            sums, onto, _ = fields[when_of(run.trial, self.loaded)]
            sums[0, first:] += run.target @ own
            onto[:, first:] += run.base.T @ own
            for used, design in run.parts:
                sums[np.ix_(1 + used, added)] += design.T @ own
            sums[first:, first:] += own.T @ own
        parts = {}
        for when, (sums, onto, room) in fields.items():
            sums[first:, :first] = sums[:first, first:].T
            parts[when] = Part(sums, onto, room)
        G, room = self.room.grown(self.G, last)
        X = _onto(parts)
        G[:, first:] = np.sum([part.sums[:, first:] for part in parts.values()], axis=0) - X.T @ X[:, first:]
        G[first:, :first] = G[:first, first:].T
        return replace(self, runs=tuple(runs), G=G, slots=(*self.slots, *fresh), room=room, parts=parts)


def when_of(trial: str, loaded: Set[str]) -> When:
    """To which part of the sums a trial belongs."""
    if not loaded:
        return "all"
    return "load" if trial in loaded else "free"


def table_of(
    runs: Sequence[Run], slots: Sequence[Slot], noise: Noise, make: Maker, loaded: Set[str] = frozenset()
) -> Table:
    """From whitened runs of the fit part.

    Args:
        loaded: trials under load, where there are others beside them.
    """
    stacked = np.concatenate([run.base for run in runs])
    stacked = stacked / (np.linalg.norm(stacked, axis=0) + 1e-300)
    # By QR on the rows themselves: the signal is ten thousand times the noise, and a Gram matrix would square
    # that. Pivoted: a column that the others span would else leave an arbitrary direction to those behind it.
    Q, R, _ = linalg.qr(stacked, mode="economic", pivoting=True, check_finite=False)
    Q = Q[:, np.abs(np.diag(R)) > 1e-9]
    target = np.concatenate([run.target for run in runs])
    target = target - Q @ (Q.T @ target)
    cuts = np.cumsum([len(run.target) for run in runs])[:-1]
    plain = [
        replace(run, target=own, base=base)
        for run, own, base in zip(runs, np.split(target, cuts), np.split(Q, cuts), strict=True)
    ]
    size = 1 + (slots[-1].columns.stop if slots else 0)
    parts = {when: _summed(plain, size, when, loaded) for when in _kinds(loaded)}
    room = Room.of(size)
    G = room.whole[:size, :size]
    X = _onto(parts)
    for begin in range(0, size, _SPARE):
        some = slice(begin, begin + _SPARE)
        G[some] = np.sum([part.sums[some] for part in parts.values()], axis=0) - X[:, some].T @ X
    return Table(tuple(plain), G, tuple(slots), units_of(plain), noise, make, room, loaded, parts)


def _onto(parts: Mapping[When, Part]) -> Floats:
    """Products of the base's directions with all columns over all rows, (P, 1 + K)."""
    return np.asarray(np.sum([part.onto for part in parts.values()], axis=0))


def _kinds(loaded: Set[str]) -> tuple[When, ...]:
    return ("free", "load") if loaded else ("all",)


def _summed(runs: Sequence[Run], size: int, when: When, loaded: Set[str]) -> Part:
    room = Room.of(size)
    sums, onto = room.whole[:size, :size], np.zeros((runs[0].base.shape[1], size))
    for run in runs:
        if when_of(run.trial, loaded) != when:
            continue
        index = np.concatenate([[0], 1 + run.used])
        Z = np.column_stack([run.target, run.design])
        sums[np.ix_(index, index)] += Z.T @ Z
        onto[:, index] += run.base.T @ Z
    return Part(sums, onto, room)


def units_of(runs: Sequence[Run]) -> Units:
    """The blocks of the given runs."""
    numbers: dict[tuple[str, int], int] = {}
    block: list[int] = []
    rows: list[float] = []
    key: list[Key] = []
    edges: list[tuple[Index, Index]] = []
    for run in runs:
        own = (run.times // BLOCK_S).astype(int)
        begins = np.concatenate([[0], np.flatnonzero(np.diff(own)) + 1]).astype(np.intp)
        first = len(block)
        for begin, end in zip(begins, [*begins[1:], len(own)], strict=True):
            block.append(numbers.setdefault((run.trial, int(own[begin])), len(numbers)))
            rows.append(float(end - begin))
            key.append(run.key)
        edges.append((begins, np.arange(first, len(block))))
    near = np.eye(len(numbers))
    for (trial, number), place in numbers.items():
        for other in (number - 1, number + 1):
            if (trial, other) in numbers:
                near[place, numbers[trial, other]] = 1.0
    of_block = np.array(block, dtype=np.intp)
    return Units(of_block, np.array(rows), tuple(key), near, tuple(edges))


def residuals(table: Table, columns: Index) -> list[Floats]:
    """What base model and the given columns, fitted to all rows, leave in each run, (N,)."""
    beta, _ = solve(table.G, columns)
    left = [run.target - run.columns(columns) @ beta for run in table.runs]
    base = sum(run.base.T @ r for run, r in zip(table.runs, left, strict=True))
    return [r - run.base @ base for run, r in zip(table.runs, left, strict=True)]


def beside(table: Table, columns: Index, others: Index) -> list[Floats]:
    """Some columns in each run without what base model and others hold of them over all rows, (N, q)."""
    root = _root(table.G, others + 1)
    shares = root.T @ (root @ table.G[np.ix_(others + 1, columns + 1)])
    left = [run.columns(columns) - run.columns(others) @ shares for run in table.runs]
    base = sum(run.base.T @ C for run, C in zip(table.runs, left, strict=True))
    return [C - run.base @ base for run, C in zip(table.runs, left, strict=True)]


@dataclass(frozen=True, slots=True)
class Swept:
    """Sums of products with some columns swept out, of which only the asked blocks are formed.

    Attributes:
        G: of the columns that are asked for, (1 + K, 1 + K).
        X: what is to be taken from it as X^T X, (P, 1 + K).
        W: (m, 1 + K), so that what is left is G - X^T X - W^T W.
        target: sums of products with what the active columns leave of the target, (1 + K,).
    """

    G: Floats
    X: Floats
    W: Floats
    target: Floats

    @property
    def left(self) -> float:
        """Residual sum of squares."""
        return float(self.target[0])

    def drop(self, columns: slice) -> float:
        """Drop of the residual sum of squares by further columns, without what the others span."""
        if columns.stop == columns.start + 1:
            return self._drop_of_one(columns.start + 1)
        index = np.arange(columns.start, columns.stop) + 1
        W, X = self.W[:, index], self.X[:, index]
        own = self.G[np.ix_(index, index)] - X.T @ X
        A, b = own - W.T @ W, self.target[index]
        there = np.diag(A) > _SPANNED * np.maximum(np.diag(own), 1e-300)
        if not there.any():
            return 0.0
        A, b = A[np.ix_(there, there)], b[there]
        if len(b) == 1:
            return float(b[0] ** 2 / A[0, 0])
        size = np.sqrt(np.diag(A))
        values, vectors = np.linalg.eigh(A / np.outer(size, size))
        good = values > 1e-6
        return float(np.sum((vectors[:, good].T @ (b / size)) ** 2 / values[good]))

    def _drop_of_one(self, place: int) -> float:
        w, x = self.W[:, place], self.X[:, place]
        own = float(self.G[place, place]) - float(x @ x)
        left = own - float(w @ w)
        if left <= _SPANNED * max(own, 1e-300):
            return 0.0
        return float(self.target[place]) ** 2 / left


def swept(table: Table, columns: Index, when: When = "all") -> Swept:
    """What is left of target and terms beside the given columns.

    Args:
        when: "free" or "load": the further terms act in those trials only.
    """
    G, index = table.G, np.asarray(columns, dtype=int) + 1
    root = _root(G, index)
    if when == "all":
        W = root @ G[index]
        return Swept(G, np.zeros((0, len(G))), W, G[0] - W[:, 0] @ W)
    part = table.parts[when]
    X = _onto(table.parts)
    W = root @ (part.sums[index] - X[:, index].T @ part.onto)
    of_target = root @ G[index, 0]
    return Swept(part.sums, part.onto, W, part.sums[0] - X[:, 0] @ part.onto - of_target @ W)


def _root(G: Floats, index: Index) -> Floats:
    """A root R of the inverse of the block of G, R^T R = G[index, index]^-1, (m, len(index))."""
    if len(index) == 0:
        return np.zeros((0, 0))
    A = G[np.ix_(index, index)]
    size = _sizes(A)
    values, vectors = np.linalg.eigh(A / np.outer(size, size))
    good = values > _RIDGE * values[-1]
    result: Floats = (vectors[:, good] / np.sqrt(values[good])).T / size
    return result


def _sizes(A: Floats) -> Floats:
    """Norms of the columns, bounded from below: one of which only rounding is left overflows nothing."""
    return np.asarray(np.sqrt(np.maximum(np.diag(A), 1e-200)))


def solve(G: Floats, columns: Index) -> tuple[Floats, float]:
    """Least-squares coefficients on the given columns, and the residual sum of squares."""
    index = np.asarray(columns, dtype=int) + 1
    if len(index) == 0:
        return np.zeros(0), float(G[0, 0])
    A, b = G[np.ix_(index, index)], G[index, 0]
    size = _sizes(A)
    # Terms that are alike to first order (a delay, a lag) share what they explain.
    values, vectors = np.linalg.eigh(A / np.outer(size, size))
    good = values > _RIDGE * values[-1]
    beta: Floats = (vectors[:, good] / values[good]) @ (vectors[:, good].T @ (b / size)) / size
    return beta, float(G[0, 0] - b @ beta)
