"""A joint's impedance with a late, one-sided stretch reflex beside inertia, damping and stiffness.

tau = I th'' + B th' + K (th - th0) + G h(t) * [th'(t - delay)]+, where [.]+ keeps one direction of stretch
and h is a critically damped second-order low-pass (Kearney, Stein and Parameswaran, IEEE Trans. Biomed. Eng.
44, 1997). Delay and low-pass are found by variable projection: for each pair the rest is linear.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.recursive import recursive, second_order

# A spinal stretch reflex of a limb takes some 30 to 80 ms; its muscle acts below some 5 Hz.
_DELAY_S = (0.03, 0.08)
_CORNER_RAD_S = (4.0, 40.0)
_ROW_RATE_HZ = 100.0
_OVERSAMPLING = 5.0
_COHERENCE_WINDOW_S = 8.0


@dataclass(frozen=True, slots=True)
class ReflexFit:
    """Impedance without and with the reflex.

    Attributes:
        intrinsic: (I, B, K) without reflex, kg m^2, N m s/rad, N m/rad; with_reflex: the same beside it.
        gain: G of either direction (positive velocity, negative velocity), N m s/rad.
        delay_s, corner_rad_s: of the reflex.
        vaf_intrinsic, vaf_reflex: on the rows held out, %.
    """

    intrinsic: tuple[float, float, float]
    with_reflex: tuple[float, float, float]
    gain: tuple[float, float]
    delay_s: float
    corner_rad_s: float
    vaf_intrinsic: float
    vaf_reflex: float


@dataclass(frozen=True, slots=True)
class Band:
    """What is compared: above `low_Hz` (0: everything) the slow drift of a voluntary torque is gone."""

    low_Hz: float = 0.5
    high_Hz: float = 40.0

    def apply(self, values: Floats, rate_hz: float) -> Floats:
        """Zero-phase band-pass along axis 0, the same for either side of the regression."""
        from scipy import signal  # noqa: PLC0415  (half a second)

        low_pass = signal.butter(4, self.high_Hz, fs=rate_hz, output="sos")
        result: Floats = signal.sosfiltfilt(low_pass, values, axis=0)
        if self.low_Hz > 0:
            high_pass = signal.butter(2, self.low_Hz, "high", fs=rate_hz, output="sos")
            result = signal.sosfiltfilt(high_pass, result, axis=0)
        return result


def followed_band(theta: Floats, torque: Floats, rate_hz: float) -> Band:
    """The band in which the torque follows the angle: what drifts by the subject's will lies below it.

    From the lowest frequency up, bins are left out while the part of the torque that is not coherent with the
    angle is more than twice its median between 1 and 5 Hz (Welch, windows of 8 s). To be asked of the fitted
    part of a record alone.

    Args:
        theta: joint angle, rad, (N,); torque: N m, (N,).
    """
    from scipy import signal  # noqa: PLC0415  (half a second)

    window = int(min(_COHERENCE_WINDOW_S * rate_hz, len(theta) // 3))
    frequency, coherence = signal.coherence(theta, torque, rate_hz, nperseg=window)
    apart = 1.0 - coherence
    usual = float(np.median(apart[(frequency > 1.0) & (frequency < 5.0)]))
    follows = np.flatnonzero((frequency > 0) & (apart <= 2.0 * usual))
    first = int(follows[0]) if len(follows) else 1
    # Nothing is below the first bin but the mean.
    return Band(0.0 if first == 1 else float(frequency[first] - 0.5 * frequency[1]))


def fit_trial_reflex(trial: AlignedTrial, held_out_s: float) -> tuple[ReflexFit, Band]:
    """A single joint's trial with a limb on it, in the band in which its fitted part follows the angle.

    Raises:
        UndeterminedError: another robot or load, gaps, or too short a trial.
    """
    if trial.theta.shape[1] != 1 or trial.kind != "arm":
        raise UndeterminedError(
            f"trial {trial.name}: a reflex is fitted to arm trials of a joint-1d; "
            "`impid-host diagnose` looks for load.delay elsewhere"
        )
    rows = np.flatnonzero(trial.valid)
    if len(rows) == 0 or len(rows) != rows[-1] - rows[0] + 1:
        raise UndeterminedError(f"trial {trial.name}: a reflex wants a record without gaps")
    theta, torque = trial.theta[rows, 0], trial.tau[rows, 0]
    fit_s = (len(rows) - 1) / trial.rate_hz - held_out_s
    early = slice(0, max(int(fit_s * trial.rate_hz), 1))
    try:
        band = followed_band(theta[early], torque[early], trial.rate_hz)
        return fit_reflex(theta, torque, trial.rate_hz, fit_s=fit_s, band=band), band
    except (UndeterminedError, ValueError) as error:
        raise UndeterminedError(f"trial {trial.name}: {error}") from error


def fit_reflex(
    theta: Floats, torque: Floats, rate_hz: float, *, fit_s: float, band: Band = Band(), edge_s: float = 1.0
) -> ReflexFit:
    """Fit on the first `fit_s` seconds, judge on the rest.

    Args:
        theta: joint angle, rad, (N,); torque: torque that drives the joint, N m, (N,); no gaps.
        rate_hz: sampling rate.
        edge_s: dropped at either end and after `fit_s`, where filters have not settled.

    Raises:
        UndeterminedError: less than 5 s on either side of `fit_s`.
    """
    t = np.arange(len(theta)) / rate_hz
    fit = (t > edge_s) & (t < fit_s)
    held = (t > fit_s + edge_s) & (t < t[-1] - edge_s)
    if min(fit.sum(), held.sum()) < 5 * rate_hz:
        raise UndeterminedError(f"{t[-1]:.1f} s do not leave 5 s on either side of {fit_s:g} s")
    velocity = np.gradient(theta, 1 / rate_hz)
    motion = np.stack([np.gradient(velocity, 1 / rate_hz), velocity, theta], axis=1)
    base = np.column_stack([band.apply(motion, rate_hz), np.ones(len(t))])
    target = band.apply(torque, rate_hz)
    smooth = Band(0.0, band.high_Hz).apply(velocity, rate_hz)
    # Everything is below the band's end now: fewer samples carry it all.
    step = max(1, int(rate_hz / (_OVERSAMPLING * band.high_Hz)))
    t, base, target, smooth = t[::step], base[::step], target[::step], smooth[::step]
    fit, held = fit[::step], held[::step]
    rate_hz = rate_hz / step

    def reflex(place: Floats) -> Floats:
        return band.apply(_reflex_columns(smooth, t, rate_hz, *place), rate_hz)

    rows = fit & (np.arange(len(t)) % max(1, round(rate_hz / _ROW_RATE_HZ)) == 0)
    place = _search(lambda at: _residual(np.column_stack([base, reflex(at)]), target, rows))
    full = np.column_stack([base, reflex(place)])
    plain, rich = _solve(base, target, rows), _solve(full, target, rows)
    return ReflexFit(
        intrinsic=(float(plain[0]), float(plain[1]), float(plain[2])),
        with_reflex=(float(rich[0]), float(rich[1]), float(rich[2])),
        gain=(float(rich[4]), float(rich[5])),
        delay_s=float(place[0]),
        corner_rad_s=float(place[1]),
        vaf_intrinsic=_vaf(target[held], base[held] @ plain),
        vaf_reflex=_vaf(target[held], full[held] @ rich),
    )


def _reflex_columns(velocity: Floats, t: Floats, rate_hz: float, delay_s: float, corner: float) -> Floats:
    """The low-passed, delayed velocity of either direction, (N, 2)."""
    late = np.interp(t - delay_s, t, velocity)
    halves = np.stack([np.maximum(late, 0.0), np.minimum(late, 0.0)], axis=1)
    return recursive(second_order(0.5 * corner / rate_hz, 1.0)[None], halves, settled=False)


def _search(cost: Callable[[Floats], float]) -> Floats:
    """Coarse grid, then a simplex within the physiological bounds."""
    from scipy import optimize  # noqa: PLC0415  (a fifth of a second)

    grid = [(delay, corner) for delay in (0.035, 0.05, 0.065) for corner in (6.0, 10.0, 18.0)]
    start = min(grid, key=lambda at: cost(np.array(at)))
    found = optimize.minimize(
        cost,
        np.array(start),
        method="Nelder-Mead",
        bounds=(_DELAY_S, _CORNER_RAD_S),
        options={"xatol": 1e-4, "fatol": 1e-9, "maxiter": 60},
    )
    return np.asarray(found.x, dtype=np.float64)


def _solve(design: Floats, target: Floats, rows: Mask) -> Floats:
    return np.asarray(np.linalg.lstsq(design[rows], target[rows], rcond=None)[0], dtype=np.float64)


def _residual(design: Floats, target: Floats, rows: Mask) -> float:
    return float(np.mean((target[rows] - design[rows] @ _solve(design, target, rows)) ** 2))


def _vaf(target: Floats, fit: Floats) -> float:
    return float(100 * (1 - np.var(target - fit) / np.var(target)))
