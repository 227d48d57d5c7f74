"""What an impedance is to vary with: time, posture, a column, or the time since a column's last rise."""

from dataclasses import dataclass

import numpy as np

from impid_host.errors import InputError, UndeterminedError
from impid_host.impedance.varying.expand import Scheduled
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats
from impid_host.signals.filters import butterworth
from impid_host.study.model import Trial

_SLOW_HZ = 0.5
_LEAST_SHARE = 0.1
_LONGEST_HOLE_S = 0.25
_SINCE = "since:"


@dataclass(frozen=True, slots=True)
class Schedule:
    """`by`: "time", "posture", "since:COLUMN", or the name of a column of robot.csv."""

    by: str

    @property
    def column(self) -> str | None:
        """The column of the robot's log that it needs."""
        if self.by in ("time", "posture"):
            return None
        return self.by.removeprefix(_SINCE)

    @property
    def columns(self) -> tuple[str, ...]:
        """What must be read of the robot's log beside what every study has; `sync` is read in any case."""
        return () if self.column is None or self.column == "sync" else (self.column,)

    @property
    def each_trial(self) -> bool:
        """Every trial has curves of its own; by anything but time, a load's trials share them."""
        return self.by == "time"

    def unit(self, place_unit: str) -> str:
        """Of the scheduling variable; "" where a column does not say."""
        if self.by == "posture":
            return place_unit
        return "s" if self.by == "time" or self.by.startswith(_SINCE) else ""

    def along(self, trials: list[tuple[Trial, AlignedTrial]]) -> list[Scheduled]:
        """One load's trials with the scheduling variable on their grids.

        Raises:
            InputError: a column is not there; UndeterminedError: nothing is left to vary with.
        """
        if self.by == "time":
            return [Scheduled(own, own.elapsed) for _, own in trials]
        if self.by == "posture":
            return posture([own for _, own in trials])
        values = [_column(raw, own, self.by.removeprefix(_SINCE)) for raw, own in trials]
        if self.by.startswith(_SINCE):
            values = since(values, [own for _, own in trials], self.by)
        return [Scheduled(own, s) for (_, own), s in zip(trials, values, strict=True)]


def posture(trials: list[AlignedTrial]) -> list[Scheduled]:
    """The slow part (below 0.5 Hz) of where the limb is, along the line on which it moves most, m (rad).

    Raises:
        UndeterminedError: less than a tenth of the motion is slow.
    """
    slow = [butterworth(2, _SLOW_HZ, trial.rate_hz).forth_and_back(trial.x) for trial in trials]
    every = np.concatenate([x[trial.valid] for x, trial in zip(slow, trials, strict=True)])
    whole = np.concatenate([trial.x[trial.valid] for trial in trials])
    middle = every.mean(axis=0)
    _, size, axes = np.linalg.svd(every - middle, full_matrices=False)
    spread = float(size[0]) / np.sqrt(len(every))
    if spread < _LEAST_SHARE * float(np.sqrt(np.sum(np.var(whole, axis=0)))):
        raise UndeterminedError(
            f"load {trials[0].load}: the posture hardly changes ({1e3 * spread:.2g} thousandths rms below "
            f"{_SLOW_HZ:g} Hz); record trials in which the limb is moved slowly while it is perturbed"
        )
    way = axes[0] * np.sign(axes[0][np.argmax(np.abs(axes[0]))])
    return [Scheduled(trial, (x - middle) @ way) for x, trial in zip(slow, trials, strict=True)]


def since(values: list[Floats], trials: list[AlignedTrial], name: str) -> list[Floats]:
    """Seconds since each column (N,) last rose through the middle of its range; before the first, nan.

    Longer than the usual interval between cues is left out: few repetitions go so far.

    Raises:
        UndeterminedError: it never rises.
    """
    rises = []
    for value in values:
        known = value[np.isfinite(value)]
        high = (
            value > 0.5 * (known.min() + known.max())
            if len(known) and np.ptp(known) > 0
            else np.zeros(len(value), bool)
        )
        rises.append(np.flatnonzero(~high[:-1] & high[1:]) + 1)
    if not any(len(rise) for rise in rises):
        raise UndeterminedError(f"{name}: the column never rises, so there is no cue to begin at")
    steps = np.concatenate([np.diff(trial.elapsed[rise]) for rise, trial in zip(rises, trials, strict=True)])
    longest = float(np.median(steps)) if len(steps) else np.inf
    out = []
    for rise, trial in zip(rises, trials, strict=True):
        s = np.full(len(trial.t), np.nan)
        for begin, end in zip(rise, [*rise[1:], len(s)], strict=True):
            s[begin:end] = trial.elapsed[begin:end] - trial.elapsed[begin]
        out.append(np.where(s <= longest, s, np.nan))
    return out


def _column(raw: Trial, aligned: AlignedTrial, name: str) -> Floats:
    """A column of the log on the aligned grid, (N,); not a number across holes."""
    log = raw.robot
    values = log.columns.get(name)
    if values is None and name == "sync" and log.sync is not None:
        values = log.sync.astype(np.float64)
    if values is None:
        raise InputError(
            f"trial {raw.name}", f"has no column {name} in its log", "name one that robot.csv has"
        )
    known = np.isfinite(values) & np.isfinite(log.t)
    if known.sum() < 2:
        raise InputError(f"trial {raw.name}", f"has no numbers in its column {name}", "name another column")
    t = log.t[known] if aligned.clock is None else aligned.clock.to_device(log.t[known])
    s: Floats = np.interp(aligned.t, t, values[known])
    after = np.clip(np.searchsorted(t, aligned.t), 1, len(t) - 1)
    hole = t[after] - t[after - 1] > max(_LONGEST_HOLE_S, 3.0 * float(np.median(np.diff(t))))
    return np.where(hole, np.nan, s)
