"""The whitened rows of a study with every term's columns: sums of squares of nested and rival models.

Sums over all rows come from one Gram matrix, blocks of two seconds from their own, made for the few columns
that are asked for. Nothing here knows what a column means.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import linalg

from impid_host.diagnosis.noise import BLOCK_S, Noise
from impid_host.diagnosis.rows import Index, Key, Run, Slot, slots_of
from impid_host.effects.effect import Term
from impid_host.signals.arrays import Floats

_RIDGE = 1e-11
_SPANNED = 1e-7  # of a column's own power: less is rounding, and the model has it already
_SPARE = 160  # columns
Maker = Callable[[Sequence[Slot]], list[Run]]


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
        return cls(np.zeros((size + _SPARE, size + _SPARE)), size)

    def grown(self, G: Floats, size: int) -> "tuple[Floats, Room]":
        """G within (size, size), zeros beyond it."""
        room = self
        if len(G) != self.filled or size > len(self.whole):
            room = Room.of(size)
            room.whole[: len(G), : len(G)] = G
        room.filled = size
        return room.whole[:size, :size], room


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
    """

    runs: tuple[Run, ...]
    G: Floats
    slots: tuple[Slot, ...]
    units: Units
    noise: Noise
    make: Maker = field(repr=False)
    room: "Room" = field(repr=False)

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
        fresh = [
            replace(slot, term=term)
            for slot in slots_of([replace(term, shapes=tuple(shapes))], len(self.G) - 1)
        ]
        made = self.make(fresh)
        first, last = len(self.G), 1 + fresh[-1].columns.stop
        G, room = self.room.grown(self.G, last)
        added = np.arange(first, last)
        B = np.zeros((self.runs[0].base.shape[1], last - first))
        for run, new in zip(self.runs, made, strict=True):
            B += run.base.T @ new.columns(added - 1)
        runs = []
        for run, new in zip(self.runs, made, strict=True):
            own = new.columns(added - 1) - run.base @ B
            G[0, first:] += run.target @ own
            for used, design in run.parts:
                G[np.ix_(1 + used, added)] += design.T @ own
            G[first:, first:] += own.T @ own
            runs.append(replace(run, further=(*run.further, (new.used, new.design))))
        G[first:, :first] = G[:first, first:].T
        return replace(self, runs=tuple(runs), G=G, slots=(*self.slots, *fresh), room=room)


def table_of(runs: Sequence[Run], slots: Sequence[Slot], noise: Noise, make: Maker) -> Table:
    """From whitened runs of the fit part."""
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
    room = Room.of(size)
    G, X = room.whole[:size, :size], np.zeros((Q.shape[1], size))
    for run in plain:
        index = np.concatenate([[0], 1 + run.used])
        Z = np.column_stack([run.target, run.design])
        G[np.ix_(index, index)] += Z.T @ Z
        X[:, index] += run.base.T @ Z
    for begin in range(0, size, _SPARE):
        some = slice(begin, begin + _SPARE)
        G[some] -= X[:, some].T @ X
    return Table(tuple(plain), G, tuple(slots), units_of(plain), noise, make, room)


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


@dataclass(frozen=True, slots=True)
class Swept:
    """The Gram matrix with some columns swept out, of which only the asked blocks are formed.

    Attributes:
        W: (m, 1 + K), so that what is left of G is G - W^T W.
    """

    G: Floats
    W: Floats

    @property
    def left(self) -> float:
        """Residual sum of squares."""
        return float(self.G[0, 0] - self.W[:, 0] @ self.W[:, 0])

    def drop(self, columns: slice) -> float:
        """Drop of the residual sum of squares by further columns, without what the others span."""
        if columns.stop == columns.start + 1:
            return self._drop_of_one(columns.start + 1)
        index = np.arange(columns.start, columns.stop) + 1
        W, own = self.W[:, index], self.G[np.ix_(index, index)]
        A, b = own - W.T @ W, self.G[index, 0] - W.T @ self.W[:, 0]
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
        w = self.W[:, place]
        own = float(self.G[place, place])
        left = own - float(w @ w)
        if left <= _SPANNED * max(own, 1e-300):
            return 0.0
        return float(self.G[place, 0] - self.W[:, 0] @ w) ** 2 / left


def swept(G: Floats, columns: Index) -> Swept:
    """G with the given columns swept out: what is left of target and terms beside them."""
    index = np.asarray(columns, dtype=int) + 1
    if len(index) == 0:
        return Swept(G, np.zeros((0, len(G))))
    A = G[np.ix_(index, index)]
    size = _sizes(A)
    values, vectors = np.linalg.eigh(A / np.outer(size, size))
    good = values > _RIDGE * values[-1]
    root = (vectors[:, good] / np.sqrt(values[good])).T
    return Swept(G, root @ (G[index] / size[:, None]))


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
