"""Short stretches of a trial unlike all the rest: someone pushed. They are left out and said, not fitted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.diagnosis.rows import Run
from impid_host.effects.view import View

_BLOCK_S = 1.0
_RATIO = 5.0  # of a block's mean squared innovation to the median of its trial's
_MOST = 0.15  # of all blocks: more is no burst
_MARGIN_S = 1.0
_LEAST_ROWS = 15  # of a channel: the mean of fewer squares strays too far
_FEW = 0.04  # so few blocks are a push; more may be noise that comes and goes


@dataclass(frozen=True, slots=True)
class Burst:
    """A stretch of a trial, s since its beginning; ratio: of its innovations' squares to the usual."""

    trial: str
    begin_s: float
    end_s: float
    ratio: float

    @property
    def words(self) -> str:
        """For the reader."""
        return f"{self.trial} from {self.begin_s:.0f} to {self.end_s:.0f} s is unlike the rest: left out"


def bursts(runs: Sequence[Run], columns: int, views: Sequence[View] = ()) -> list[Burst]:
    """Blocks whose innovations stand out, in torque and force, of whitened runs of both parts.

    Args:
        columns: all of them belong to the model; it is fitted on the fit part.
        views: of the trials; noise may grow with the square of the speed.
    """
    own = [run for run in runs if run.family in ("torque", "force")]
    fit = [run for run in own if run.part == "fit"]
    design = np.concatenate([run.design[:, :columns] for run in fit])
    size = np.linalg.norm(design, axis=0) + 1e-300
    target = np.concatenate([run.target for run in fit])
    beta = np.linalg.lstsq(design / size, target, rcond=1e-10)[0] / size
    squares: dict[str, dict[int, list[float]]] = {}
    # Where the band is low, rows are few in a second.
    length = max([_BLOCK_S, *(1.05 * _LEAST_ROWS * run.step_s for run in own)])
    for run in own:
        r2 = (run.target - run.design[:, :columns] @ beta) ** 2
        block = ((run.begin_s + run.step_s * np.arange(len(r2))) // length).astype(int)
        for number in np.flatnonzero(np.bincount(block) >= _LEAST_ROWS):
            squares.setdefault(run.trial, {}).setdefault(int(number), []).append(
                float(np.mean(r2[block == number]))
            )
    found = []
    total = sum(len(blocks) for blocks in squares.values())
    haste = {view.name: _haste(view, length) for view in views}
    for trial, blocks in squares.items():
        # A push is felt by one channel more than by another, so the largest counts.
        level = {number: max(values) for number, values in blocks.items()}
        usual = float(np.median(list(level.values())))
        found += [
            Burst(trial, number * length, (number + 1) * length, value / usual)
            for number, value in level.items()
            if value > _RATIO * usual * haste.get(trial, {}).get(number, 1.0)
        ]
    return _joined(found) if len(found) <= _MOST * total else []


def _joined(found: Sequence[Burst]) -> list[Burst]:
    """Blocks that follow one another are one event."""
    events: list[Burst] = []
    for burst in sorted(found, key=lambda one: (one.trial, one.begin_s)):
        last = events[-1] if events else None
        if last is not None and last.trial == burst.trial and burst.begin_s <= last.end_s + 1e-6:
            events[-1] = replace(last, end_s=burst.end_s, ratio=max(last.ratio, burst.ratio))
        else:
            events.append(burst)
    return events


def _haste(view: View, length: float) -> dict[int, float]:
    """Largest mean squared speed of a joint in each block over the trial's median, 1 at least."""
    block = (view.t // length).astype(int)
    count = np.maximum(np.bincount(block), 1)
    squares = [np.bincount(block, weights=omega**2) / count for omega in view.omega.T]
    ratio = np.max([own / max(float(np.median(own)), 1e-300) for own in squares], axis=0)
    return {number: max(1.0, float(value)) for number, value in enumerate(ratio)}


def are_pushes(found: Sequence[Burst], duration_s: float) -> bool:
    """Whether so few blocks stand out in so many seconds that it is an event, not the weather."""
    return bool(found) and len(found) <= max(3.0, _FEW * duration_s / _BLOCK_S)


def without_bursts(view: View, found: Sequence[Burst]) -> View:
    """The view with the bursts and a margin around them marked as not to be used."""
    valid = view.valid.copy()
    for burst in found:
        if burst.trial == view.name:
            valid &= ~((view.t > burst.begin_s - _MARGIN_S) & (view.t < burst.end_s + _MARGIN_S))
    return replace(view, valid=valid)
