"""From views to regression rows: every column low-passed alike, decimated until the noise is about white."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from impid_host.diagnosis.base import Base, targets
from impid_host.diagnosis.holdout import Holdout
from impid_host.effects.effect import Candidate
from impid_host.effects.view import ANGLE, FAMILIES, View
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import erode
from impid_host.signals.filters import ZeroPhaseLowPass

CUTOFF_HZ = 11.0
_LOW = ZeroPhaseLowPass(order=5, cutoff_hz=CUTOFF_HZ)
_EDGE_S = 0.5
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


def filtered(values: Floats, view: View) -> Floats:
    """The low-pass that everything passes; any shape with time first."""
    return values if view.rate_hz < 2.5 * CUTOFF_HZ else _LOW.apply(values, view.rate_hz)


def build_runs(
    view: View, base: Base, slots: Sequence[Slot], holdout: Holdout, *, first: int = 0
) -> list[Run]:
    """All rows of a trial; with `first` > 0, the slots alone, whose columns begin there."""
    width = (slots[-1].columns.stop if slots else base.size) - first
    blocks = _blocks(view, base, slots, width, first)
    step = max(1, int(view.rate_hz / (2.2 * CUTOFF_HZ)))
    edge = int(_EDGE_S * view.rate_hz)
    runs = []
    for family, (target, design) in blocks.items():
        target, design = filtered(target, view), filtered(design, view)
        for part in _PARTS:
            kept = np.flatnonzero(erode(holdout.mask(view, part), edge))
            kept = kept[kept % step == 0]
            if len(kept) < 2:
                continue
            for rows in np.split(kept, np.flatnonzero(np.diff(kept) != step) + 1):
                for channel in range(target.shape[1]):
                    runs.append(
                        Run(
                            view.name,
                            family,
                            channel,
                            part,
                            float(view.t[rows[0]]),
                            step * view.dt,
                            target[rows, channel],
                            design[rows, channel],
                        )
                    )
    return _without_clock_match(runs, view) if ANGLE in blocks else runs


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


def _without_clock_match(runs: list[Run], view: View) -> list[Run]:
    """Take out of the angle rows what the match of the clocks is free to choose: offset, rate, constants."""
    result = [run for run in runs if run.family != ANGLE]
    angle = [run for run in runs if run.family == ANGLE]
    speed = filtered(view.omega, view)
    nuisance = []
    for run in angle:
        rows = np.round((run.begin_s + run.step_s * np.arange(len(run.target))) / view.dt).astype(int)
        w = speed[rows, run.channel]
        block = np.zeros((len(rows), 2 + view.joints))
        block[:, 0], block[:, 1] = w, w * (view.t[rows] - 0.5 * view.t[-1])
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
