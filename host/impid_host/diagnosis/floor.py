"""What noise alone leaves in each channel, told without the model that is judged by it.

A saturated regression (the papers' model, every effect of the catalogue at several shapes, smooth curves of
everything) leaves noise, less the share that so many columns take by chance; that share is given back by the
rows' leverage. Where a record is so short that the columns take nearly all of it, what they leave says
nothing, and the floor is unknown. Where a motion was repeated, the difference of its residuals is noise
whatever the model. Neither can be less than resolution and data sheet say. The noise of torque and of
acceleration is then propagated through the robot model and the virtual sensor, as the signals are.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, signal

from impid_host.diagnosis.base import Base
from impid_host.diagnosis.case import Case
from impid_host.diagnosis.correct import corrected
from impid_host.diagnosis.holdout import FIT, SEALED
from impid_host.diagnosis.noise import autoregression
from impid_host.diagnosis.proof import channel
from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.repeats import Repeat, repeats
from impid_host.diagnosis.result import Floor
from impid_host.diagnosis.rows import Index, Key, Run, Slot, rows_of, slots_of
from impid_host.effects.view import ANGLE, View
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.filters import butterworth

_ROUNDS = 2
_DRAWS = 40
_EDGE_S = 0.3  # where the narrow filter has not settled
ADXL203_NOISE = 110e-6 * 9.80665  # m/s^2/sqrt(Hz), data sheet: at rest, it can be no less
RATED_HZ = 1000.0  # of logs in the study format
PER_COLUMN = 6  # independent rows for each column of the saturated regression
# Degrees of freedom left by the columns on the held-out rows: an rms of so many is known to a factor of 1.5
# within two standard errors (1 - 2 / sqrt(2 n) = 1 / 1.5), above which an error counts as more than noise.
FREE = 18


@dataclass(frozen=True, slots=True)
class _Noise:
    """Noise of one trial's rows, (N, c) by family, and where in the view they lie, (N,)."""

    view: View
    place: Index
    by_family: Mapping[str, Floats]


def noise_floor(
    case: Case,
    fit: Refit,
    rich: Sequence[Slot],
    lines_Hz: Sequence[float] = (),
    resolution: Mapping[str, Floats] | None = None,
) -> Floor:
    """The floor, by all that tell of it.

    Args:
        fit: effects that are taken out first; what they miss, the columns take.
        rich: terms of the saturated regression.
        lines_Hz: of what hums, which has no column there.
        resolution: smallest steps in the logs by family, (c,).
    """
    plain = _runs(case, fit, rich)
    again = [_repeated(repeat, plain[0].step_s) for repeat in repeats(plain, fit.views, fit.base)]
    steps = [_specified(view, resolution or {}) for view in fit.views]
    return Floor(
        _rms(_noise(fit, plain, lines_Hz), fit, case.base),
        _rms([part for part in again if part is not None], fit, case.base),
        _rms(steps, fit, case.base),
    )


def _runs(case: Case, fit: Refit, rich: Sequence[Slot]) -> list[Run]:
    """Raw rows of both parts with the effects taken out, and the saturated regression's columns."""
    slots = slots_of([replace(slot.term, shapes=(slot.shape,)) for slot in rich])
    cleaned = [corrected(view, fit.chosen) for view in fit.views]
    return [run for view in cleaned for run in rows_of(view, case.base, slots, case.holdout, (FIT, SEALED))]


def _rms(parts: Sequence[_Noise], fit: Refit, base: Base) -> dict[str, float]:
    free = any(view.load is None for view in fit.views)
    squares: dict[str, list[Floats]] = {}
    for part in parts:
        for key, value in _propagated(part, fit, base, free=free).items():
            if np.isfinite(value).all():  # a noise that is unknown makes unknown what it enters
                squares.setdefault(key, []).append(value)
    return {key: float(np.sqrt(np.mean(np.concatenate(own)))) for key, own in squares.items()}


def _repeated(repeat: Repeat, step_s: float) -> _Noise | None:
    by_family = {}
    place = repeat.place
    for family, values in repeat.by_family.items():
        narrow = _narrow(values, step_s, repeat.view.report_hz)
        if narrow is None:
            return None
        by_family[family] = narrow[0]
        place = repeat.place[np.round(narrow[1] / step_s).astype(int)]
    return _Noise(repeat.view, place, by_family)


def _specified(view: View, resolution: Mapping[str, Floats]) -> _Noise:
    """Rounding is white up to half the rate of the log, which is no slower than the view's."""
    place = np.arange(0, len(view.t), 50)
    band = np.sqrt(2 * view.report_hz / max(view.rate_hz, RATED_HZ))
    by_family = {
        family: np.tile(step / np.sqrt(12.0) * band, (len(place), 1)) for family, step in resolution.items()
    }
    by_family.setdefault("torque", np.zeros((len(place), view.joints)))
    if view.measured is not None:
        by_family["specific_force"] = np.full((len(place), 2), ADXL203_NOISE * np.sqrt(view.report_hz))
    if view.force is None or view.load is None:
        by_family.pop("force", None)
    return _Noise(view, place, by_family)


def _noise(fit: Refit, runs: Sequence[Run], lines_Hz: Sequence[float]) -> list[_Noise]:
    left: dict[str, dict[Key, list[Floats]]] = {}
    trials = sorted({run.trial for run in runs})
    report = fit.views[0].report_hz
    for key in dict.fromkeys(run.key for run in runs if run.family != ANGLE):
        own = [run for run in runs if run.key == key]
        wanted = np.unique(np.concatenate([run.used for run in own]))
        parts: list[tuple[Run, Floats, Floats]] = []
        for run in own:
            stacked = [run.target, run.base, run.columns(wanted), _hum(run, trials, lines_Hz)]
            narrow = _narrow(np.column_stack(stacked), run.step_s, report)
            if narrow is not None:
                parts.append((run, narrow[0], run.begin_s + narrow[1]))
        if not parts:
            continue
        held = np.concatenate([np.full(len(rows), run.part == SEALED) for run, rows, _ in parts])
        series = noise_series([rows for _, rows, _ in parts], held)
        for (run, _, place), noise in zip(parts, series, strict=True):
            if run.part == SEALED:
                left.setdefault(run.trial, {}).setdefault(key, []).append(np.column_stack([place, noise]))
    views = {view.name: view for view in fit.views}
    return [_of_trial(views[trial], channels) for trial, channels in left.items()]


def _of_trial(view: View, channels: Mapping[Key, Sequence[Floats]]) -> _Noise:
    joined = {key: np.concatenate(parts) for key, parts in channels.items()}
    families = {family for family, _ in joined}
    place = np.round(next(iter(joined.values()))[:, 0] / view.dt).astype(int)
    by_family = {
        family: np.stack([joined[key][:, 1] for key in sorted(joined) if key[0] == family], axis=1)
        for family in families
    }
    return _Noise(view, place, by_family)


def _hum(run: Run, trials: Sequence[str], lines_Hz: Sequence[float]) -> Floats:
    """Lines in either part of each trial by themselves, growing or waning: columns, (N, k)."""
    t = run.times
    block = np.zeros((len(t), 2 * len(trials), 4 * len(lines_Hz)))
    for k, frequency in enumerate(lines_Hz):
        c, s = np.cos(2 * np.pi * frequency * t), np.sin(2 * np.pi * frequency * t)
        u = (t - t.mean()) / max(float(np.ptp(t)), 1e-9)
        place = 2 * trials.index(run.trial) + (run.part == FIT)
        block[:, place, 4 * k : 4 * k + 4] = np.stack([c, s, u * c, u * s], axis=1)
    return block.reshape(len(t), -1)


def _narrow(rows: Floats, step_s: float, cutoff_hz: float) -> tuple[Floats, Floats] | None:
    """The rows in the band that is reported, without their ends; and their times since the run began."""
    edge = round(_EDGE_S / step_s)
    if len(rows) < 4 * edge + 30:
        return None
    result = butterworth(5, cutoff_hz, 1 / step_s).forth_and_back(rows)
    inside = slice(edge, len(rows) - edge, max(1, int(1 / (2.2 * cutoff_hz * step_s))))
    return result[inside], np.asarray(step_s * np.arange(len(rows))[inside], dtype=np.float64)


def noise_series(parts: Sequence[Floats], held: Mask) -> list[Floats]:
    """Residuals (N,) of stretches [target | columns], scaled to the noise behind them on the `held` rows.

    What so many columns take of the noise by chance depends on its colour: found by sending noise of the
    residual's own autoregression through the same regression. NaN where they leave too little to tell.
    """
    stacked = np.concatenate(parts)
    if not stacked[:, 0].any():  # a joint without a drive logs zeros, and no noise
        return [part[:, 0] for part in parts]
    size = np.linalg.norm(stacked[:, 1:], axis=0)
    used = 1 + np.flatnonzero(size > 1e-12 * size.max(initial=0.0))
    # By QR: a singular value decomposition of columns that are nearly alike need not converge.
    U, R, _ = linalg.qr(stacked[:, used] / size[used - 1], mode="economic", pivoting=True, check_finite=False)
    pivots = np.abs(np.diag(R))
    U = U[:, pivots > 1e-7 * pivots[0]]
    free = 1.0 - np.sum(U[held] ** 2, axis=1)
    if np.sum(free) < max(FREE, 0.5 * len(free)):
        # Columns that take more than they leave take slow noise whole, and its colour with it.
        return [np.full(len(part), np.nan) for part in parts]
    residual = stacked[:, 0] - U @ (U.T @ stacked[:, 0])
    cuts = np.cumsum([len(part) for part in parts])[:-1]
    generator = np.random.default_rng(0)
    share = 1.0 - U.shape[1] / len(residual)
    for _ in range(_ROUNDS):
        taps = autoregression([r / np.sqrt(share) for r in np.split(residual, cuts)])
        draws = np.concatenate(
            [
                signal.lfilter([1.0], taps, generator.normal(size=(len(p) + 50, _DRAWS)), axis=0)[50:]
                for p in parts
            ]
        )
        left = draws - U @ (U.T @ draws)
        share = float(np.sum(left[held] ** 2) / np.sum(draws[held] ** 2))
    return np.split(residual / np.sqrt(share), cuts)


def _propagated(noise: _Noise, fit: Refit, base: Base, *, free: bool) -> dict[str, Floats]:
    """Squared noise of each reported channel of one trial, (N,)."""
    view, k = noise.view, noise.place
    tau = noise.by_family["torque"]
    felt = noise.by_family.get("specific_force")
    along = None
    if felt is not None and view.sensor_angle is not None:
        c, s = np.cos(view.sensor_angle[k]), np.sin(view.sensor_angle[k])
        turn = np.stack([np.stack([c, -s], axis=1), np.stack([s, c], axis=1)], axis=1)
        along = np.einsum("kij,kj->ki", turn, felt)
    J = view.J[k]
    inertia = _inertia(base, view.theta[k], fit.base[: base.robot])
    through = None if along is None else np.linalg.solve(J, along[:, :, None])[:, :, 0]
    by_acc = None if through is None else np.einsum("kij,kj->ki", inertia, through)
    torque = tau**2 if by_acc is None else tau**2 + by_acc**2
    torques = {f"tau{joint + 1}": torque[:, joint] for joint in range(view.joints)}
    if view.load is None:
        return torques
    J_T = np.swapaxes(J, 1, 2)
    force = np.linalg.pinv(J_T) @ tau[:, :, None]
    squares = force[:, :, 0] ** 2
    virtual = squares
    if by_acc is not None and along is not None:
        robot_part = (np.linalg.pinv(J_T) @ by_acc[:, :, None])[:, :, 0]
        load = dict(base.loads)[view.load]
        d = len(load.axes)
        M = (load.matrix_map("a") @ fit.base[base.slot(view.load)]).reshape(d, d)
        squares = squares + (robot_part + along @ M.T) ** 2
        virtual = virtual + robot_part**2
    axes = base.model.task_axes
    result = {} if free else torques
    parts = {"f": squares}
    if "force" in noise.by_family:
        parts["fs"] = virtual + noise.by_family["force"] ** 2
    for start, values in parts.items():
        for axis, letter in enumerate(axes):
            result[channel(start, letter, has_torque=free)] = values[:, axis]
    return result


def _inertia(base: Base, theta: Floats, alpha: Floats) -> Floats:
    """Joint inertia matrices by the robot's regressor, (N, n, n)."""
    still = np.zeros_like(theta)
    level = base.structure.regressor(theta, still, still) @ alpha
    columns = []
    for joint in range(theta.shape[1]):
        unit = still.copy()
        unit[:, joint] = 1.0
        columns.append(base.structure.regressor(theta, still, unit) @ alpha - level)
    return np.stack(columns, axis=2)


def resolution_of(logs: Sequence[tuple[Floats, Floats | None]]) -> dict[str, Floats]:
    """Smallest steps of torque and force over the logs, by family, (c,).

    Args:
        logs: torque (N, n) and force (N, d) or None, of each trial.
    """
    result = {"torque": _steps([tau for tau, _ in logs])}
    forces = [force for _, force in logs if force is not None]
    if forces:
        result["force"] = _steps(forces)
    return result


def _steps(signals: Sequence[Floats]) -> Floats:
    values = [np.concatenate([signal[:, c] for signal in signals]) for c in range(signals[0].shape[1])]
    steps = [np.diff(np.unique(np.round(own, 12))) for own in values]
    return np.array([float(own.min()) if len(own) else 0.0 for own in steps])
