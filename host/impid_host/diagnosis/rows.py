"""From views to regression rows: every column low-passed alike, decimated until the noise is about white."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from impid_host.diagnosis.base import Base, targets
from impid_host.diagnosis.holdout import FIT, Holdout, settled
from impid_host.effects.effect import Each, Term
from impid_host.effects.view import ANGLE, FAMILIES, Columns, View
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.filters import FiniteResponse, windowed_sinc

_EDGE_S = 0.5
_MOST_PARTS = 12  # of columns that came later; beyond, they are put side by side
REFERENCE = "reference"
Index = NDArray[np.intp]
Key = tuple[str, int]
"""Family and channel."""


@dataclass(frozen=True, slots=True)
class Slot:
    """Where a term at one shape stands among the columns of all terms."""

    term: Term
    shape: float
    columns: slice


@dataclass(frozen=True, slots=True)
class Run:
    """Contiguous rows of one channel of one trial.

    Only a seventh of all columns is not zero in a channel of a trial; only those are kept.

    Attributes:
        begin_s: time of the first row; step_s: between rows.
        target: (N,); base: columns of the base model, (N, p).
        used: which columns of the terms are not zero here, (k,), rising; design: those, (N, k), in single
            precision: a column is never told from another by its seventh digit.
        further: the same of columns behind those, which came later.
    """

    trial: str
    family: str
    channel: int
    part: str
    begin_s: float
    step_s: float
    target: Floats
    base: Floats
    used: Index
    design: NDArray[np.float32]
    further: tuple[tuple[Index, NDArray[np.float32]], ...] = ()

    @property
    def key(self) -> Key:
        """Channels of one key share a noise model."""
        return (self.family, self.channel)

    @property
    def times(self) -> Floats:
        """Of the rows, s, (N,)."""
        return np.asarray(self.begin_s + self.step_s * np.arange(len(self.target)))

    def columns(self, wanted: Index) -> Floats:
        """The wanted columns of all terms, zeros where they are none here, (N, len(wanted))."""
        result = np.zeros((len(self.target), len(wanted)))
        for used, design in self.parts:
            there, place = _places(used, wanted)
            if there.any():
                result[:, there] = design[:, place[there]]
        return result

    @property
    def parts(self) -> tuple[tuple[Index, NDArray[np.float32]], ...]:
        """Numbers and values of all columns that are not zero here."""
        return ((self.used, self.design), *self.further)

    def with_columns(self, used: Index, design: NDArray[np.float32]) -> "Run":
        """With columns behind all others, (k,) and (N, k)."""
        if len(used) == 0:
            return self
        parts = (*self.further, (used, design))
        if len(parts) > _MOST_PARTS:
            joined = (
                np.concatenate([own for own, _ in parts]),
                np.concatenate([own for _, own in parts], axis=1),
            )
            parts = (joined,)
        return replace(self, further=parts)

    def has(self, wanted: Index) -> bool:
        """Whether any of the wanted columns is not zero here."""
        return any(bool(_places(used, wanted)[0].any()) for used, _ in self.parts)


def _places(used: Index, wanted: Index) -> tuple[Mask, Index]:
    """Which of the wanted numbers are among the rising `used`, and where."""
    if len(used) == 0:
        return np.zeros(len(wanted), dtype=bool), np.zeros(len(wanted), dtype=np.intp)
    place = np.minimum(np.searchsorted(used, wanted), len(used) - 1)
    return used[place] == wanted, place


def slots_of(terms: Iterable[Term], first: int = 0) -> list[Slot]:
    """Column places of every term at every shape, from `first` on."""
    result = []
    for term in terms:
        for shape in term.shapes:
            result.append(Slot(term, shape, slice(first, first + term.size)))
            first += term.size
    return result


_PROBE = 97  # a column is looked at in so many places before it is read as a whole


@dataclass(frozen=True, slots=True)
class Decimator:
    """A symmetric FIR low-pass (Kaiser window, 60 dB) at every `step`-th instant."""

    step: int
    low_pass: FiniteResponse

    def __call__(self, values: Floats) -> Floats:
        """(N, ...) -> (ceil(N / step), ...)."""
        if self.step == 1:
            return values
        plain = values.reshape(len(values), -1)
        used = _alive(plain)  # most columns act in one channel of several
        low = np.zeros((-(-len(values) // self.step), plain.shape[1]))
        if len(used):
            some = plain if len(used) == plain.shape[1] else plain[:, used]
            low[:, used] = self.low_pass.apply(some, len(self.low_pass.taps) // 2)
        return low.reshape(-1, *values.shape[1:])


def _alive(plain: Floats) -> Index:
    """Numbers of the columns of (N, c) that are not zero."""
    alive = np.asarray(plain[::_PROBE].any(axis=0))
    if not alive.all():
        alive[~alive] = plain[:, ~alive].any(axis=0)
    return np.flatnonzero(alive)


def decimator(view: View) -> Decimator:
    """Down to about 2.2 rows per cycle of the band's end."""
    return _decimator(view.rate_hz, view.cutoff_hz)


@lru_cache(maxsize=16)
def _decimator(rate_hz: float, cutoff_hz: float) -> Decimator:
    step = max(1, int(rate_hz / (2.2 * cutoff_hz)))
    taps = windowed_sinc(np.kaiser(2 * 6 * step + 1, 6.0), cutoff_hz / rate_hz)
    return Decimator(step, FiniteResponse.of(taps, step))


def rows_of(
    view: View, base: Base | None, slots: Sequence[Slot], holdout: Holdout, parts: Sequence[str] = (FIT,)
) -> list[Run]:
    """All rows of some parts of a trial; without a base the columns of the slots alone, targets zero."""
    lower = decimator(view)
    kept = [
        (part, rows)
        for part in parts
        for rows in _stretches(settled(holdout.mask(view, part), view.rate_hz, _EDGE_S)[:: lower.step])
    ]
    if not kept:
        return []
    measured = targets(view)
    by_family = {} if base is None else {family: lower(block) for family, block in base.columns(view).items()}
    size = 0 if base is None else base.size
    # What is remembered of a motion is dropped with its rows.
    columns = _low_columns(replace(view, memo={}), slots, measured, lower)
    runs = []
    count = -(-len(view.t) // lower.step)
    for family in FAMILIES:
        if family not in measured:
            continue
        target = lower(measured[family]) if base is not None else np.zeros((count, measured[family].shape[1]))
        own = by_family.get(family)
        for channel in range(target.shape[1]):
            place, design = _used(columns.get(family, []), channel, len(target))
            model = np.zeros((count, size)) if own is None else own[:, channel]
            for part, rows in kept:
                begin, step_s = float(view.t[rows[0] * lower.step]), lower.step * view.dt
                own_rows = (target[rows, channel], model[rows], place, design[rows])
                runs.append(Run(view.name, family, channel, part, begin, step_s, *own_rows))
    return _without_clock_match(runs, view, lower) if ANGLE in measured else runs


def columns_in(term: Term, view: View, shape: float) -> Columns:
    """What one unit of each of the term's parameters adds to a trial; nothing where it does not act."""
    return term.columns(view, shape) if term.acts_in(view) else {}


def _low_columns(
    view: View, slots: Sequence[Slot], measured: Mapping[str, Floats], lower: Decimator
) -> dict[str, list[tuple[int, Floats]]]:
    """By family, first column and decimated block (M, c, q) of every slot that adds something."""
    result: dict[str, list[tuple[int, Floats]]] = {}
    shared: dict[tuple[int, float], Columns] = {}
    for slot in slots:
        if not slot.term.acts_in(view):
            continue
        columns, first = slot.term.columns, slot.columns.start
        if isinstance(columns, Each):
            own = columns.first(view)
            if own is None:
                continue
            columns, first = columns.inner, first + own
        # The same effect in some trials only, or with a value for each, has the same columns.
        key = (id(columns), slot.shape)
        if key not in shared:
            found = columns(view, slot.shape)
            shared[key] = {family: lower(block) for family, block in found.items() if family in measured}
        for family, block in shared[key].items():
            result.setdefault(family, []).append((first, block))
    return result


def _used(
    blocks: Sequence[tuple[int, Floats]], channel: int, count: int
) -> tuple[Index, NDArray[np.float32]]:
    """Which columns a channel has, (k,), and they, (N, k)."""
    places, parts = [], []
    for first, block in blocks:
        own = block[:, channel]
        alive = np.flatnonzero(own.any(axis=0))
        if len(alive):
            places.append(first + alive)
            parts.append(own[:, alive])
    if not parts:
        return np.zeros(0, dtype=np.intp), np.zeros((count, 0), dtype=np.float32)
    place = np.concatenate(places)
    order = np.argsort(place, kind="stable")
    return place[order], np.concatenate(parts, axis=1)[:, order].astype(np.float32)


def _stretches(kept: Mask) -> list[Index]:
    """Indices of the contiguous stretches of two rows and more."""
    rows = np.flatnonzero(kept)
    parts = np.split(rows, np.flatnonzero(np.diff(rows) != 1) + 1)
    return [part for part in parts if len(part) > 1]


def _without_clock_match(runs: list[Run], view: View, lower: Decimator) -> list[Run]:
    """Take out of the angle rows what the match of the clocks is free to choose: offset, rate, constants."""
    angle = [run for run in runs if run.family == ANGLE]
    speed, clock = lower(view.omega), view.t[:: lower.step] - 0.5 * view.t[-1]
    nuisance = []
    for run in angle:
        rows = round(run.begin_s / run.step_s) + np.arange(len(run.target))
        w = speed[rows, run.channel]
        block = np.zeros((len(rows), 2 + view.joints))
        block[:, 0], block[:, 1] = w, w * clock[rows]
        block[:, 2 + run.channel] = 1.0
        nuisance.append(block)
    if not angle:
        return runs
    wanted = np.unique(np.concatenate([run.used for run in angle]))
    fit = [k for k, run in enumerate(angle) if run.part == FIT] or list(range(len(angle)))
    N = np.concatenate([nuisance[k] for k in fit])
    Z = np.concatenate([np.column_stack([angle[k].target, angle[k].columns(wanted)]) for k in fit])
    size = np.linalg.norm(N, axis=0) + 1e-300
    gain = np.linalg.lstsq(N / size, Z, rcond=1e-10)[0] / size[:, None]
    result = [run for run in runs if run.family != ANGLE]
    for block, run in zip(nuisance, angle, strict=True):
        left = np.column_stack([run.target, run.columns(wanted)]) - block @ gain
        result.append(replace(run, target=left[:, 0], used=wanted, design=left[:, 1:].astype(np.float32)))
    return result


def mapped(runs: Sequence[Run], change: Callable[[Run, Floats], Floats]) -> list[Run]:
    """Runs with all their columns changed alike; rows lost in front move the beginning.

    Args:
        change: a run and [target | base | design] (N, 1 + p + k) -> the same for fewer rows.
    """
    result = []
    for run in runs:
        p = run.base.shape[1]
        Z = change(run, np.column_stack([run.target, run.base, run.design]))
        if len(Z) > 1:
            lost = len(run.target) - len(Z)
            begin = run.begin_s + lost * run.step_s
            result.append(
                replace(
                    run,
                    begin_s=begin,
                    target=Z[:, 0].copy(),  # not a view: that would keep all of Z
                    base=Z[:, 1 : 1 + p].copy(),
                    design=Z[:, 1 + p :].astype(np.float32),
                )
            )
    return result
