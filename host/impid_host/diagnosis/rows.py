"""From views to regression rows: every column low-passed alike, decimated until the noise is about white."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal, sparse

from impid_host.diagnosis.base import Base, targets
from impid_host.diagnosis.holdout import Holdout, settled
from impid_host.effects.effect import Candidate
from impid_host.effects.view import ANGLE, FAMILIES, View
from impid_host.signals.arrays import Floats, Mask

_EDGE_S = 0.5
Index = NDArray[np.intp]
_PARTS = ("fit", "validation")


@dataclass(frozen=True, slots=True)
class Run:
    """Contiguous rows of one channel of one trial: target (N,), design (N, k), both over all columns.

    Attributes:
        begin_s: time of the first row; step_s: between rows.
    """

    trial: str
    family: str
    channel: int
    part: str
    begin_s: float
    step_s: float
    target: Floats
    design: Floats

    @property
    def key(self) -> tuple[str, int]:
        """Channels of one key share a noise model."""
        return (self.family, self.channel)


@dataclass(frozen=True, slots=True)
class Slot:
    """Where a candidate at one shape stands among the columns."""

    candidate: Candidate
    shape: float
    columns: slice


def slots_of(candidates: Sequence[Candidate], first: int) -> list[Slot]:
    """Column places of every candidate at every shape, from `first` on."""
    result = []
    for candidate in candidates:
        for shape in candidate.shapes:
            result.append(Slot(candidate, shape, slice(first, first + candidate.size)))
            first += candidate.size
    return result


@dataclass(frozen=True, slots=True)
class Decimator:
    """The low-pass that everything passes, at every `step`-th instant: rows (M, N) of a sparse matrix."""

    step: int
    matrix: sparse.csr_matrix

    def __call__(self, values: Floats) -> Floats:
        """(N, ...) -> (M, ...); columns that are zero throughout cost nothing."""
        plain = values.reshape(len(values), -1)
        used = np.flatnonzero(np.any(plain != 0, axis=0))
        result = np.zeros((self.matrix.shape[0], plain.shape[1]))
        result[:, used] = self.matrix @ np.ascontiguousarray(plain[:, used])
        return result.reshape(-1, *values.shape[1:])


def decimator(view: View) -> Decimator:
    """A symmetric FIR low-pass (Kaiser window, 60 dB) down to about 2.2 rows per cycle of the cut-off."""
    step = max(1, int(view.rate_hz / (2.2 * view.cutoff_hz)))
    count = len(view.t)
    if step == 1:
        return Decimator(1, sparse.identity(count, format="csr"))
    half = 6 * step
    taps = signal.firwin(2 * half + 1, view.cutoff_hz, fs=view.rate_hz, window=("kaiser", 6.0))
    centres = np.arange(0, count, step)
    place = centres[:, None] + np.arange(-half, half + 1)
    inside = (place >= 0) & (place < count)
    rows = np.broadcast_to(np.arange(len(centres))[:, None], place.shape)
    weights = np.broadcast_to(taps, place.shape)
    matrix = sparse.csr_matrix((weights[inside], (rows[inside], place[inside])), shape=(len(centres), count))
    return Decimator(step, matrix)


def build_runs(
    view: View, base: Base, slots: Sequence[Slot], holdout: Holdout, *, first: int = 0
) -> list[Run]:
    """All rows of a trial; with `first` > 0, the slots alone, whose columns begin there."""
    width = (slots[-1].columns.stop if slots else base.size) - first
    blocks = _blocks(view, base, slots, width, first)
    lower = decimator(view)
    kept = {
        part: _stretches(settled(holdout.mask(view, part), view.rate_hz, _EDGE_S)[:: lower.step])
        for part in _PARTS
    }
    runs = []
    for family, (target, design) in blocks.items():
        y, Z = lower(target), lower(design)
        for part in _PARTS:
            for rows in kept[part]:
                begin = float(view.t[rows[0] * lower.step])
                runs += [
                    Run(
                        view.name,
                        family,
                        channel,
                        part,
                        begin,
                        lower.step * view.dt,
                        y[rows, channel],
                        Z[rows, channel],
                    )
                    for channel in range(target.shape[1])
                ]
    return _without_clock_match(runs, view, lower) if ANGLE in blocks else runs


def _blocks(
    view: View, base: Base, slots: Sequence[Slot], width: int, first: int
) -> dict[str, tuple[Floats, Floats]]:
    measured = targets(view)
    blocks = {
        family: (measured[family], np.zeros((*measured[family].shape, width)))
        for family in FAMILIES
        if family in measured
    }
    for family, columns in base.columns(view).items() if first == 0 else ():
        blocks[family][1][:, :, : base.size] = columns
    for slot in slots:
        for family, columns in slot.candidate.columns(view, slot.shape).items():
            if family in blocks:
                blocks[family][1][:, :, slot.columns.start - first : slot.columns.stop - first] = columns
    return blocks


def _stretches(kept: Mask) -> list[Index]:
    """Indices of the contiguous stretches of two rows and more."""
    rows = np.flatnonzero(kept)
    parts = np.split(rows, np.flatnonzero(np.diff(rows) != 1) + 1)
    return [part for part in parts if len(part) > 1]


def _without_clock_match(runs: list[Run], view: View, lower: Decimator) -> list[Run]:
    """Take out of the angle rows what the match of the clocks is free to choose: offset, rate, constants."""
    result = [run for run in runs if run.family != ANGLE]
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
    fit = [k for k, run in enumerate(angle) if run.part == "fit"] or list(range(len(angle)))
    if not angle:
        return result
    N = np.concatenate([nuisance[k] for k in fit])
    Z = np.concatenate([np.column_stack([angle[k].target, angle[k].design]) for k in fit])
    size = np.linalg.norm(N, axis=0) + 1e-300
    gain = np.linalg.lstsq(N / size, Z, rcond=1e-10)[0] / size[:, None]
    for block, run in zip(nuisance, angle, strict=True):
        fitted = block @ gain
        result.append(
            Run(
                run.trial,
                run.family,
                run.channel,
                run.part,
                run.begin_s,
                run.step_s,
                run.target - fitted[:, 0],
                run.design - fitted[:, 1:],
            )
        )
    return result


def mapped(runs: Sequence[Run], change: Callable[[Run], tuple[Floats, Floats, int]]) -> list[Run]:
    """Runs with target and design replaced; `change` gives them and how many rows were lost in front."""
    result = []
    for run in runs:
        target, design, lost = change(run)
        if len(target) > 1:
            result.append(
                Run(
                    run.trial,
                    run.family,
                    run.channel,
                    run.part,
                    run.begin_s + lost * run.step_s,
                    run.step_s,
                    target,
                    design,
                )
            )
    return result


Taps = Mapping[tuple[str, int], Floats]
