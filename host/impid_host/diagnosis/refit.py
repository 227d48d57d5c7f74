"""The chosen effects' parameters, non-linear ones included, fitted once more together on corrected signals.

The choice linearises every effect about the papers' fit. Here the effects are taken out where they act, and
robot, loads and effects are fitted together by Gauss-Newton (Golub and Pereyra, Inverse Problems 19, 2003,
variable projection, in Kaufman's form), on the same whitened rows of the fit part.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from impid_host.diagnosis.base import Base
from impid_host.diagnosis.holdout import Holdout
from impid_host.diagnosis.parameters import at, has_shape, moves, parted, vector_of, with_fine
from impid_host.diagnosis.proof import corrected
from impid_host.diagnosis.result import Chosen
from impid_host.diagnosis.rows import Run, Taps, build_runs
from impid_host.diagnosis.support import BLOCK_S
from impid_host.diagnosis.whiten import whitened
from impid_host.effects.view import View
from impid_host.signals.arrays import Floats

_ROUNDS = 5
_SETTLED = 0.02  # of a standard deviation
_STEP = 0.2  # of a standard deviation, for the slopes
_HALVINGS = 3
_REACH = 2.0  # a shape may leave its grid by this factor


@dataclass(frozen=True, slots=True)
class Refit:
    """Effects fitted together.

    Attributes:
        views: with the model of this fit in them.
        chosen: with their values.
        covariance: (k, k) of all effects' parameters in order, see parameters.vector_of.
        base: value of the robot's and the loads' parameters, (b,).
    """

    views: tuple[View, ...]
    chosen: tuple[Chosen, ...]
    covariance: Floats
    base: Floats


@dataclass(frozen=True, slots=True)
class _Rows:
    """Whitened rows of the fit part: target (N,), design (N, b); block of time of each row, (N,)."""

    target: Floats
    design: Floats
    block: Floats


def refit(views: Sequence[View], chosen: Sequence[Chosen], base: Base, holdout: Holdout, taps: Taps) -> Refit:
    """Gauss-Newton from the choice's values; where it leads nowhere better, those stay."""
    first = _fine(views, tuple(chosen), base, holdout, taps)
    vector, sd = vector_of(first), _first_guess(first)
    views, rows, value = _informed(views, first, base, holdout, taps)
    cost = _cost(rows, value)
    covariance = np.diag(sd**2)
    for _ in range(_ROUNDS if len(first) else 0):
        slopes = _slopes(views, at(first, vector), value, sd, base, holdout, taps)
        step, covariance = _solve(rows, value, slopes)
        sd = np.sqrt(np.diag(covariance))
        for halving in range(_HALVINGS + 1):
            trial = vector + step * 0.5**halving
            if not _possible(at(first, trial)):
                continue
            moved = _informed(views, at(first, trial), base, holdout, taps)
            if (now := _cost(moved[1], moved[2])) <= cost * (1 + 1e-9):
                (views, rows, value), vector, cost = moved, trial, now
                break
        else:
            break
        if np.all(np.abs(step) < _SETTLED * moves(first, sd)):
            break
    chosen = at(first, vector)
    return Refit(tuple(views), parted(covariance, chosen), covariance, value)


def _fine(
    views: Sequence[View], chosen: tuple[Chosen, ...], base: Base, holdout: Holdout, taps: Taps
) -> tuple[Chosen, ...]:
    """The parts, with the best of the first guesses of their fine parameters."""
    for place, part in enumerate(chosen):
        if part.candidate.finer is None:
            continue
        tried = []
        for value in part.candidate.fines:
            other = (*chosen[:place], with_fine(part, value), *chosen[place + 1 :])
            rows = _rows(views, other, base, holdout, taps)
            tried.append((_cost(rows, _base_value(rows)), value))
        chosen = (*chosen[:place], with_fine(part, min(tried)[1]), *chosen[place + 1 :])
    return chosen


def _first_guess(chosen: Sequence[Chosen]) -> Floats:
    """Standard deviations before there is a slope for the shapes, (k,)."""
    parts = []
    for part in chosen:
        own = np.sqrt(np.maximum(np.diag(part.covariance), 1e-300))[: len(part.beta)]
        if has_shape(part):
            own = np.append(own, 0.01 * abs(part.shape))
        parts.append(own if part.fine is None else np.append(own, 0.5))
    return np.concatenate(parts) if parts else np.zeros(0)


def _possible(chosen: Sequence[Chosen]) -> bool:
    for part in chosen:
        shapes = part.candidate.shapes
        if has_shape(part) and not min(shapes) / _REACH < part.shape < max(shapes) * _REACH:
            return False
        if not part.candidate.gate(part.beta, part.shape):
            return False
    return True


def _informed(
    views: Sequence[View], chosen: Sequence[Chosen], base: Base, holdout: Holdout, taps: Taps
) -> tuple[Sequence[View], _Rows, Floats]:
    """The views with robot and loads as they come out with the effects taken out, and the rows there.

    A load's effects depend on its equilibrium, and that on the effects: twice is enough.
    """
    rows = _rows(views, chosen, base, holdout, taps)
    value = _base_value(rows)
    for part in chosen:
        if part.candidate.effect.startswith(("load.", "actuator.", "elastic.transmission", "gravity.")):
            views = [base.informed(view, value) for view in views]
            rows = _rows(views, chosen, base, holdout, taps)
            value = _base_value(rows)
            break
    return views, rows, value


def _rows(views: Sequence[View], chosen: Sequence[Chosen], base: Base, holdout: Holdout, taps: Taps) -> _Rows:
    runs: list[Run] = []
    for view in views:
        runs += build_runs(corrected(view, chosen), base, [], holdout)
    white = [run for run in whitened(runs, taps) if run.part == "fit"]
    trials = {name: number for number, name in enumerate(sorted({run.trial for run in white}))}
    block = [
        1000.0 * trials[run.trial] + (run.begin_s + run.step_s * np.arange(len(run.target))) // BLOCK_S
        for run in white
    ]
    return _Rows(
        np.concatenate([run.target for run in white]),
        np.concatenate([run.design for run in white]),
        np.concatenate(block),
    )


def _base_value(rows: _Rows) -> Floats:
    size = np.linalg.norm(rows.design, axis=0) + 1e-300
    Q, R = np.linalg.qr(rows.design / size)
    value: Floats = np.linalg.lstsq(R, Q.T @ rows.target, rcond=1e-10)[0] / size
    return value


def _cost(rows: _Rows, value: Floats) -> float:
    return float(np.sum((rows.target - rows.design @ value) ** 2))


def _slopes(
    views: Sequence[View],
    chosen: Sequence[Chosen],
    value: Floats,
    sd: Floats,
    base: Base,
    holdout: Holdout,
    taps: Taps,
) -> Floats:
    """d residual / d parameter at fixed robot and loads, (N, k), by central differences."""
    vector, size = vector_of(chosen), moves(chosen, _STEP * sd)
    columns = []
    for k in range(len(vector)):
        move = np.zeros_like(vector)
        move[k] = size[k]
        sides = []
        for sign in (1.0, -1.0):
            rows = _rows(views, at(chosen, vector + sign * move), base, holdout, taps)
            sides.append(rows.target - rows.design @ value)
        columns.append((sides[0] - sides[1]) / (2 * move[k]))
    return np.stack(columns, axis=1)


def _solve(rows: _Rows, value: Floats, slopes: Floats) -> tuple[Floats, Floats]:
    """Step of the effects' parameters (k,), and their covariance (k, k) with robot and loads free."""
    residual = rows.target - rows.design @ value
    J = np.hstack([rows.design, -slopes])
    size = np.linalg.norm(J, axis=0)
    size = np.where(size > 0, size, 1.0)
    Q, R = np.linalg.qr(J / size)
    inverse = np.linalg.pinv(R, rcond=1e-10)
    step = inverse @ (Q.T @ residual) / size
    left = residual - Q @ (Q.T @ residual)
    count, width = J.shape
    bread = inverse @ inverse.T
    plain = bread * float(left @ left) / max(count - width, 1)
    # Scores summed over blocks of time and channels keep what correlation whitening has left.
    _, number = np.unique(rows.block, return_inverse=True)
    scores = np.zeros((number.max() + 1, width))
    np.add.at(scores, number, (J / size) * left[:, None])
    blocks = len(scores)
    robust = bread @ (scores.T @ scores) @ bread * blocks / max(blocks - 1, 1)
    robust = robust * (stats.t.ppf(0.975, max(blocks - 1, 2)) / stats.norm.ppf(0.975)) ** 2
    ratio = np.diag(robust) / np.maximum(np.diag(plain), 1e-300)
    raised = np.sqrt(np.maximum(ratio, 1.0))
    covariance = plain * np.outer(raised, raised) / np.outer(size, size)
    own = slice(rows.design.shape[1], None)
    return step[own], covariance[own, own]
