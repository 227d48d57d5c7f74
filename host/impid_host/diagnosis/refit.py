"""The chosen terms' parameters, non-linear ones included, fitted once more together on corrected signals.

The search linearises every effect about the first model. Here the effects are taken out where they act, and
robot, loads and effects are fitted together by Gauss-Newton (Golub and Pereyra, Inverse Problems 19, 2003),
on the whitened rows of the fit part.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.diagnosis.case import Case
from impid_host.diagnosis.correct import corrected, with_true_model
from impid_host.diagnosis.noise import BLOCK_S, Taps, whitened
from impid_host.diagnosis.parameters import at, count_of, fits_shape, parted, vector_of
from impid_host.diagnosis.result import Chosen
from impid_host.diagnosis.rows import REFERENCE, Key, Run, rows_of, slots_of
from impid_host.effects.bounds import possible
from impid_host.effects.effect import Term
from impid_host.effects.view import Columns, View
from impid_host.signals.arrays import Floats
from impid_host.signals.quantiles import NORMAL_975, student_975

_ROUNDS = 5
_SETTLED = 0.05  # of a standard deviation
_HALVINGS = 3
_STEP = 0.01  # of a shape, for its slope
_REACH = 2.0  # a shape may leave its grid by this factor


@dataclass(frozen=True, slots=True)
class Refit:
    """Effects fitted together.

    Attributes:
        views: with the model of this fit in them, the effects still in the signals.
        chosen: with their values.
        covariance: (k, k) of all effects' parameters in order, see parameters.vector_of.
        base: value of the robot's and the loads' parameters, (b,).
        deviance: -2 log likelihood with each channel's noise level its own, in the units of the logs as
            they were measured, up to a constant.
    """

    views: tuple[View, ...]
    chosen: tuple[Chosen, ...]
    covariance: Floats
    base: Floats
    deviance: float


@dataclass(frozen=True, slots=True)
class _Rows:
    """Whitened rows of the fit part: target (N,), base (N, b), slopes of the effects' parameters (N, k).

    Attributes:
        block: number of each row's block of time, (N,).
    """

    target: Floats
    base: Floats
    slopes: Floats
    block: Floats


def refit(case: Case, chosen: Sequence[Chosen], taps: Taps) -> Refit:
    """Gauss-Newton from the search's values; where it leads nowhere better, those stay."""
    views, chosen = case.views, tuple(chosen)
    vector = vector_of(chosen)
    rows = _rows(case, views, chosen, taps)
    value, cost = _base_value(rows)
    covariance = np.zeros((len(vector), len(vector)))
    by_model = any(part.term.by_model for part in chosen)
    for _ in range(_ROUNDS if chosen else 0):
        if by_model:
            views = _informed(case, views, chosen, value)
            rows = _rows(case, views, at(chosen, vector), taps)
            value, cost = _base_value(rows)
        step, covariance, value = _solved(rows)
        sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        for halving in range(_HALVINGS + 1):
            trial = vector + step * 0.5**halving
            if not _possible(at(chosen, trial)):
                continue
            moved = _rows(case, views, at(chosen, trial), taps)
            there, now = _base_value(moved)
            if now <= cost * (1 + 1e-9):
                rows, value, vector, cost = moved, there, trial, now
                break
        else:
            break
        if np.all(np.abs(step) < _SETTLED * sd):
            break
    chosen = at(chosen, vector)
    if chosen:
        covariance = _solved(rows)[1]
    views = tuple(_informed(case, views, chosen, value))
    deviance = _deviance(case, views, chosen, value, taps)
    return Refit(views, parted(covariance, chosen), covariance, value, deviance)


def _deviance(
    case: Case, views: Sequence[View], chosen: Sequence[Chosen], value: Floats, taps: Taps
) -> float:
    """-2 log likelihood of what was measured, each channel's noise level its own, up to a constant.

    Effects are put into the prediction here, not taken out of the signals: undoing a lag or a gain would
    change the noise with the signal.
    """
    squares: dict[Key, list[Floats]] = {}
    for view in views:
        if view.name not in case.holdout.fit:
            continue
        left = _left_as_measured(case, view, chosen, value)
        for run in whitened(rows_of(left, case.base, [], case.holdout), taps):
            squares.setdefault(run.key, []).append(run.target**2)
    joined = [np.concatenate(parts) for parts in squares.values()]
    return sum(len(own) * float(np.log(np.mean(own) + 1e-300)) for own in joined)


def _left_as_measured(case: Case, view: View, chosen: Sequence[Chosen], value: Floats) -> View:
    """The trial with the prediction, effects and all, subtracted from what was measured."""
    true = case.base.informed(corrected(view, chosen), value)
    assert true.response is not None
    change: dict[str, Floats] = {}
    for part in chosen:
        if part.term.moves or not part.term.acts_in(view):
            continue
        if part.term.forward is not None:
            added = part.term.forward(true, part.beta)
        else:
            blocks = part.term.columns(true, part.shape)
            added = {family: block @ part.beta for family, block in blocks.items()}
        for family, own in added.items():
            change[family] = change[family] + own if family in change else own
    nothing = np.zeros(())
    left = replace(true, tau=view.tau - true.response["torque"] - change.get("torque", nothing))
    if view.measured is not None:
        left = replace(left, measured=view.measured - change.get("specific_force", nothing))
    if view.force is not None and "force" in true.response:
        left = replace(left, force=view.force + true.response["force"] + change.get("force", nothing))
    return left


def _informed(case: Case, views: Sequence[View], chosen: Sequence[Chosen], value: Floats) -> tuple[View, ...]:
    return tuple(with_true_model(view, chosen, case.base, value) for view in views)


def _possible(chosen: Sequence[Chosen]) -> bool:
    for part in chosen:
        shapes = part.term.shapes
        if fits_shape(part) and not min(shapes) / _REACH < part.shape < max(shapes) * _REACH:
            return False
        if part.term.named and not possible(part.term, part.beta, part.shape):
            return False
    return True


def with_slope(part: Chosen) -> Term:
    """A term whose columns are the slopes by each parameter that is fitted, the shape's among them."""
    if not fits_shape(part):
        return replace(part.term, shapes=(part.shape,))
    term = part.term

    def columns(view: View, shape: float) -> Columns:
        step = _STEP * abs(shape)
        here = term.columns(view, shape)
        up, down = term.columns(view, shape + step), term.columns(view, shape - step)
        return {
            family: np.concatenate(
                [own, ((up[family] - down[family]) @ part.beta / (2 * step))[:, :, None]], axis=2
            )
            for family, own in here.items()
        }

    return replace(term, columns=columns, size=count_of(part), shapes=(part.shape,))


def _rows(case: Case, views: Sequence[View], chosen: Sequence[Chosen], taps: Taps) -> _Rows:
    slots = slots_of([with_slope(part) for part in chosen])
    runs: list[Run] = []
    for view in views:
        if view.name in case.holdout.fit:
            runs += whitened(rows_of(corrected(view, chosen), case.base, slots, case.holdout), taps)
    if case.references is not None:
        runs.append(case.references)
    wanted = np.arange(slots[-1].columns.stop if slots else 0)
    trials = {name: number for number, name in enumerate(sorted({run.trial for run in runs}))}
    return _Rows(
        np.concatenate([run.target for run in runs]),
        np.concatenate([run.base for run in runs]),
        np.concatenate([run.columns(wanted) for run in runs]),
        np.concatenate([1e6 * trials[run.trial] + _block(run) for run in runs]),
    )


def _block(run: Run) -> Floats:
    if run.family == REFERENCE:
        return np.arange(len(run.target), dtype=np.float64)
    return np.asarray(run.times // BLOCK_S, dtype=np.float64)


def _base_value(rows: _Rows) -> tuple[Floats, float]:
    """Value of the base model (b,) at these effects, and the sum of squares that it leaves."""
    size = np.linalg.norm(rows.base, axis=0) + 1e-300
    R, projection = _triangle(rows.base / size, rows.target)
    value: Floats = np.linalg.lstsq(R, projection, rcond=1e-10)[0] / size
    return value, float(np.sum((rows.target - rows.base @ value) ** 2))


def _triangle(design: Floats, target: Floats) -> tuple[Floats, Floats]:
    """R (k, k) and Q^T target (k,) of the design's QR decomposition, without Q."""
    k = design.shape[1]
    whole: Floats = np.asarray(np.linalg.qr(np.column_stack([design, target]), mode="r"), dtype=np.float64)
    return whole[:k, :k], whole[:k, k]


def _solved(rows: _Rows) -> tuple[Floats, Floats, Floats]:
    """Step of the effects (k,), their covariance (k, k) with robot and loads free, base value (b,)."""
    J = np.hstack([rows.base, rows.slopes])
    size = np.linalg.norm(J, axis=0)
    size = np.where(size > 0, size, 1.0)
    R, projection = _triangle(J / size, rows.target)
    inverse = np.linalg.pinv(R, rcond=1e-10)
    found = inverse @ projection / size
    left = rows.target - J @ found
    count, width = J.shape
    bread = inverse @ inverse.T
    plain = bread * float(left @ left) / max(count - width, 1)
    # Scores summed over blocks of time and channels keep what correlation whitening has left.
    _, number = np.unique(rows.block, return_inverse=True)
    scores = np.zeros((number.max() + 1, width))
    np.add.at(scores, number, (J / size) * left[:, None])
    blocks = len(scores)
    robust = bread @ (scores.T @ scores) @ bread * blocks / max(blocks - 1, 1)
    robust = robust * (student_975(max(blocks - 1, 2)) / NORMAL_975) ** 2
    ratio = np.diag(robust) / np.maximum(np.diag(plain), 1e-300)
    raised = np.sqrt(np.maximum(ratio, 1.0))
    covariance = plain * np.outer(raised, raised) / np.outer(size, size)
    b = rows.base.shape[1]
    return found[b:], covariance[b:, b:], found[:b]
