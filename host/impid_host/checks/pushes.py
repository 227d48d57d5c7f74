"""Pushes in a fitted study: stretches that the model leaves unlike the rest, and what they do to M, B and K.

The stretches are those that `diagnose` calls events, found by the same finder in what `fit` leaves. The fit
itself keeps them; the same fit without them stands beside it, so that a reader sees what they changed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from impid_host.diagnosis.events import Event, events
from impid_host.diagnosis.noise import autoregression, whitened
from impid_host.diagnosis.rows import Run
from impid_host.effects.view import FORCE, TORQUE, View
from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import Options, StudyFit, fit_aligned
from impid_host.impedance.identify import LoadFit, RobotFit
from impid_host.impedance.rows import Series
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats, Mask
from impid_host.study.model import Study

MARGIN_S = 1.0  # left out around a push, as `diagnose` does: the filters remember it
_MEDIAN_OF_SQUARES = 0.4549  # of standard normal numbers
_LEAST_ROWS = 20  # of a stretch between gaps; in fewer there is no block to judge


@dataclass(frozen=True, slots=True)
class Push:
    """One stretch of a trial that is unlike the rest: a push, a slip, a collision, or a lack of the model.

    Attributes:
        begin_s, end_s: since the trial's first instant.
        ratio: of the residual's power there to that of an ordinary stretch of the trial.
        fitted: it took part in the fit; otherwise it lies in the held-out end alone.
    """

    trial: str
    begin_s: float
    end_s: float
    ratio: float
    fitted: bool


@dataclass(frozen=True, slots=True)
class Pushes:
    """All pushes of a study and the fit without them.

    Attributes:
        found: in the order of the trials' names.
        robot, loads: the fits that change, without the pushes and `MARGIN_S` around them; empty where no
            push took part in the fit.
        reason: why there is no fit without them, where the rest determines none.
    """

    found: tuple[Push, ...] = ()
    robot: RobotFit | None = None
    loads: tuple[LoadFit, ...] = ()
    reason: str = ""

    def of(self, trial: str) -> tuple[Push, ...]:
        """The pushes of one trial."""
        return tuple(push for push in self.found if push.trial == trial)

    def without(self, fit: LoadFit) -> LoadFit | None:
        """The same load by the same method without the pushes, if they took part in it."""
        same = (some for some in self.loads if (some.load, some.method) == (fit.load, fit.method))
        return next(same, None)


def find_pushes(study: Study, fit: StudyFit, options: Options) -> Pushes:
    """Look for pushes in what a fit leaves of whole trials, and fit again without them.

    Args:
        options: those of the fit.
    """
    trials = {trial.name: trial for trial in fit.trials}
    found = tuple(_push(event, trials[event.trial], options) for event in _events(fit))
    pushed = {push.trial for push in found if push.fitted}
    if not pushed:
        return Pushes(found)
    robot = fit.robot
    new_robot = isinstance(robot, RobotFit) and any(trials[name].kind == "free" for name in pushed)
    parameters = robot.parameters if isinstance(robot, RobotFit) else robot
    terms = tuple(term.name for term in parameters.structure.terms)
    changed = {trials[name].load for name in pushed}
    again = [
        replace(trial, valid=trial.valid & ~_pushed(trial, found))
        for trial in fit.trials
        if trial.kind == "free" or (trial.kind != "stochastic" and (new_robot or trial.load in changed))
    ]
    try:
        rest = fit_aligned(
            study,
            again,
            replace(options, terms=terms, physical=False),
            robot=None if new_robot else robot,
        )
    except UndeterminedError as error:
        return Pushes(found, reason=str(error))
    return Pushes(found, rest.robot if new_robot and isinstance(rest.robot, RobotFit) else None, rest.loads)


def _events(fit: StudyFit) -> list[Event]:
    """The diagnosis' finder on whitened residuals of robot and loads."""
    runs = list(_runs(fit))
    if not runs:
        return []
    keys = {run.key for run in runs}
    taps = {key: autoregression([run.target for run in runs if run.key == key]) for key in keys}
    white = whitened(runs, taps)
    # A push swells the variance of the one channel that feels it; each counts by its ordinary rows.
    usual = {key: _usual_variance([run.target for run in white if run.key == key]) for key in keys}
    # The finder reads a trial's name, time and speed, and nothing else of a view.
    motions = [_Motion(trial.name, trial.elapsed, trial.omega) for trial in fit.trials]
    left = [run.target / np.sqrt(usual[run.key]) for run in white]
    return events(white, left, cast(Sequence[View], motions))


def _usual_variance(innovations: Sequence[Floats]) -> float:
    """Of normal noise whose squares have this median: rows of a push are too few to move it."""
    if not innovations:
        return 1.0
    return max(float(np.median(np.concatenate(innovations) ** 2)) / _MEDIAN_OF_SQUARES, 1e-300)


@dataclass(frozen=True, slots=True)
class _Motion:
    """Of one trial: t, s, (N,); omega, (N, n)."""

    name: str
    t: Floats
    omega: Floats


def _runs(fit: StudyFit) -> Iterator[Run]:
    """Residuals of whole trials; Method 2's channels are told from Method 1's by their numbers."""
    cutoff_hz = fit.cutoff_hz
    if isinstance(fit.robot, RobotFit):
        for part in fit.robot.series:
            yield from _of_series(part, TORQUE, 0, cutoff_hz)
    for load in fit.loads:
        first = 0 if load.method == "virtual sensor" else len(load.model.axes)
        for part in load.series:
            yield from _of_series(part, FORCE, first, cutoff_hz)


def _of_series(part: Series, family: str, first: int, cutoff_hz: float | None) -> Iterator[Run]:
    """Stretches without gaps, thinned until filtered noise is about white, channel by channel."""
    if len(part.t) < 2:
        return
    period = float(np.median(np.diff(part.t)))
    step = 1 if cutoff_hz is None else max(1, int(1 / (2.2 * cutoff_hz * period)))
    rows = np.arange(0, len(part.t), step)
    rest, shown, t = (part.target - part.fit)[rows], part.shown[rows], part.t[rows]
    kept = np.flatnonzero(shown)
    for stretch in np.split(kept, np.flatnonzero(np.diff(kept) != 1) + 1):
        if len(stretch) < _LEAST_ROWS:
            continue
        for channel in range(rest.shape[1]):
            none = np.zeros((len(stretch), 0))
            yield Run(
                trial=part.trial,
                family=family,
                channel=first + channel,
                part="whole",
                begin_s=float(t[stretch[0]]),
                step_s=step * period,
                target=rest[stretch, channel],
                base=none,
                used=np.zeros(0, dtype=np.intp),
                design=none.astype(np.float32),
            )


def _push(event: Event, trial: AlignedTrial, options: Options) -> Push:
    in_fit, _ = options.split.masks(trial, options.chain)
    fitted = bool(np.any(in_fit & _between(trial, event.begin_s, event.end_s)))
    return Push(event.trial, event.begin_s, event.end_s, event.ratio, fitted)


def _pushed(trial: AlignedTrial, found: Sequence[Push]) -> Mask:
    """Instants of a trial that belong to a push which was fitted, (N,)."""
    mask = np.zeros(len(trial.t), dtype=bool)
    for push in found:
        if push.trial == trial.name and push.fitted:
            mask |= _between(trial, push.begin_s - MARGIN_S, push.end_s + MARGIN_S)
    return mask


def _between(trial: AlignedTrial, begin_s: float, end_s: float) -> Mask:
    return np.asarray((trial.elapsed > begin_s) & (trial.elapsed < end_s))
