"""Short stretches of a trial unlike all the rest: someone pushed.

In the fit part they are left out of the fit and said. The sealed part is judged with all that is in it; an
event there is said beside the number.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.diagnosis.noise import BLOCK_S
from impid_host.diagnosis.rows import Run
from impid_host.effects.view import FORCE, TORQUE, View
from impid_host.signals.arrays import Floats

_RATIO = 5.0  # of a block's mean squared innovation to the median of its trial's
_MOST = 0.15  # of all blocks: more is no event, but noise that comes and goes
_LEAST_ROWS = 15  # of a channel: the mean of fewer squares strays too far


@dataclass(frozen=True, slots=True)
class Event:
    """A stretch of a trial, s since its beginning; ratio: of its innovations' squares to the usual."""

    trial: str
    begin_s: float
    end_s: float
    ratio: float

    @property
    def words(self) -> str:
        """For the reader."""
        return f"{self.trial} from {self.begin_s:.0f} to {self.end_s:.0f} s is unlike the rest"


def events(runs: Sequence[Run], left: Sequence[Floats], views: Sequence[View]) -> list[Event]:
    """Blocks whose innovations stand out, in torque and force.

    Args:
        runs: whitened; left: what the model leaves in each, (N,).
        views: of the trials; noise may grow with the square of the speed.
    """
    squares: dict[str, dict[int, list[float]]] = {}
    for run, r in zip(runs, left, strict=True):
        if run.family not in (TORQUE, FORCE):
            continue
        block = (run.times // BLOCK_S).astype(int)
        for number in np.flatnonzero(np.bincount(block) >= _LEAST_ROWS):
            squares.setdefault(run.trial, {}).setdefault(int(number), []).append(
                float(np.mean(r[block == number] ** 2))
            )
    found = []
    total = sum(len(blocks) for blocks in squares.values())
    speed = {view.name: _speed(view) for view in views}
    for trial, blocks in squares.items():
        # A push is felt by one channel more than by another, so the largest counts.
        level = {number: max(values) for number, values in blocks.items()}
        usual = float(np.median(list(level.values())))
        found += [
            Event(trial, number * BLOCK_S, (number + 1) * BLOCK_S, value / usual)
            for number, value in level.items()
            if value > _RATIO * usual * speed.get(trial, {}).get(number, 1.0)
        ]
    return _joined(found) if len(found) <= _MOST * total else []


def _joined(found: Sequence[Event]) -> list[Event]:
    """Blocks that follow one another are one event."""
    result: list[Event] = []
    for event in sorted(found, key=lambda one: (one.trial, one.begin_s)):
        last = result[-1] if result else None
        if last is not None and last.trial == event.trial and event.begin_s <= last.end_s + 1e-6:
            result[-1] = replace(last, end_s=event.end_s, ratio=max(last.ratio, event.ratio))
        else:
            result.append(event)
    return result


def _speed(view: View) -> dict[int, float]:
    """Largest mean squared speed of a joint in each block over the trial's median, 1 at least."""
    block = (view.t // BLOCK_S).astype(int)
    count = np.maximum(np.bincount(block), 1)
    squares = [np.bincount(block, weights=omega**2) / count for omega in view.omega.T]
    ratio = np.max([own / max(float(np.median(own)), 1e-300) for own in squares], axis=0)
    return {number: max(1.0, float(value)) for number, value in enumerate(ratio)}
