"""A joint's impedance as a parallel cascade: inertia, damping and stiffness beside a late, one-sided reflex.

tau = I th'' + B th' + K (th - th0) + G h(t) * [th'(t - delay)]+, both directions of stretch offered (see
`reflex_path`). Delay and muscle are found by variable projection, then by Gauss and Newton's steps whose last
solutions are those of `fit_linear`: intervals hold for coloured noise, and hold delay and muscle as well.
Beside it stand a spring and a damper that are not straight: how much of what is left they take.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.colour import colour_of
from impid_host.impedance.linear import Estimate, Stretch, fit_linear
from impid_host.impedance.reflex_path import CORNER_RAD_S, CORNERS_RAD_S, DELAY_S, DELAYS_S, ReflexPath
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.filters import five_point_difference

CLAIMED_BELOW = 0.01
_ROW_RATE_HZ = 100.0
_OVERSAMPLING = 6.0
_COHERENCE_WINDOW_S = 8.0
_AR_ORDER = 12
_PLAIN_STEPS, _STEPS = 5, 8
_DRAWS = 20_000
_NAMES = ("I", "B", "K", "offset", "gain +", "gain -", "delay", "corner")


@dataclass(frozen=True, slots=True)
class Number:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class ReflexFit:
    """Impedance without and with the reflex.

    Attributes:
        intrinsic: (I, B, K) without reflex, kg m^2, N m s/rad, N m/rad; with_reflex: the same beside it.
        gain: G of either direction (positive velocity, negative velocity), N m s/rad.
        delay_s, corner_rad_s: of the reflex; intervals end at the bounds of what is physiological.
        p_value: how often a joint without reflex would look so much like one with it.
        vaf_intrinsic, vaf_reflex: on the rows held out, %; vaf_curved: with a spring (th^2, th^3) and a
            damper (|th'| th') that are not straight besides.
    """

    intrinsic: tuple[Number, Number, Number]
    with_reflex: tuple[Number, Number, Number]
    gain: tuple[Number, Number]
    delay_s: Number
    corner_rad_s: Number
    p_value: float
    vaf_intrinsic: float
    vaf_reflex: float
    vaf_curved: float

    @property
    def claimed(self) -> bool:
        """Whether the data ask for a reflex."""
        return self.p_value < CLAIMED_BELOW

    @property
    def delay_determined(self) -> bool:
        """The delay's interval ends inside its bounds."""
        return self.delay_s.low > DELAY_S[0] and self.delay_s.high < DELAY_S[1]


@dataclass(frozen=True, slots=True)
class Band:
    """What is compared: above `low_Hz` (0: everything) the slow drift of a voluntary torque is gone."""

    low_Hz: float = 0.5
    high_Hz: float = 40.0

    def apply(self, values: Floats, rate_hz: float) -> Floats:
        """Zero-phase band-pass along axis 0, the same for either side of the regression."""
        from scipy import signal  # noqa: PLC0415  (half a second)

        result: Floats = values
        if self.high_Hz < 0.45 * rate_hz:
            low_pass = signal.butter(4, self.high_Hz, fs=rate_hz, output="sos")
            result = signal.sosfiltfilt(low_pass, result, axis=0)
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
    rows = _Rows(theta, torque, rate_hz, fit_s, band, edge_s)
    place = rows.coarse()
    place, estimate = rows.refined(place)
    p_value = rows.p_value(place)
    plain = rows.linear(rows.base, _NAMES[:4])
    rich = np.column_stack([rows.base, rows.reflex(place)])
    curved = np.column_stack([rich, rows.curves])
    ci, value = estimate.ci95, estimate.value
    numbers = [Number(float(v), float(low), float(high)) for v, (low, high) in zip(value, ci, strict=True)]
    half = 0.5 * (ci[6:, 1] - ci[6:, 0])
    delay, corner = (
        Number(float(at), max(float(at - h), low), min(float(at + h), high))
        for at, h, (low, high) in zip(place, half, (DELAY_S, CORNER_RAD_S), strict=True)
    )
    return ReflexFit(
        intrinsic=tuple(  # type: ignore[arg-type]
            Number(float(v), float(low), float(high))
            for v, (low, high) in zip(plain.value[:3], plain.ci95[:3], strict=True)
        ),
        with_reflex=(numbers[0], numbers[1], numbers[2]),
        gain=(numbers[4], numbers[5]),
        delay_s=delay,
        corner_rad_s=corner,
        p_value=p_value,
        vaf_intrinsic=rows.vaf(rows.base),
        vaf_reflex=rows.vaf(rich),
        vaf_curved=rows.vaf(curved),
    )


class _Rows:
    """One record, filtered alike on both sides, at as few samples as the band needs."""

    def __init__(
        self, theta: Floats, torque: Floats, rate_hz: float, fit_s: float, band: Band, edge_s: float
    ) -> None:
        t = np.arange(len(theta)) / rate_hz
        velocity = five_point_difference(theta, rate_hz)
        motion = np.stack([five_point_difference(velocity, rate_hz), velocity, theta], axis=1)
        smooth = Band(0.0, band.high_Hz).apply(np.stack([theta, velocity], axis=1), rate_hz)
        step = max(1, int(rate_hz / (_OVERSAMPLING * band.high_Hz)))
        self.band, self.rate_hz = band, rate_hz / step
        self.base = np.column_stack([band.apply(motion, rate_hz), np.ones(len(t))])[::step]
        self.target = band.apply(torque, rate_hz)[::step]
        angle, speed = smooth[::step].T
        angle = angle - angle.mean()
        self.curves = band.apply(np.stack([angle**2, angle**3, np.abs(speed) * speed], axis=1), self.rate_hz)
        self._path = ReflexPath(speed, self.rate_hz)
        t = t[::step]
        fit = (t > edge_s) & (t < fit_s)
        self.held: Mask = (t > fit_s + edge_s) & (t < t[-1] - edge_s)
        if min(fit.sum(), self.held.sum()) < 5 * self.rate_hz:
            raise UndeterminedError(f"{t[-1]:.1f} s do not leave 5 s on either side of {fit_s:g} s")
        self.rows = np.flatnonzero(fit)[:: max(1, round(self.rate_hz / _ROW_RATE_HZ))]

    def reflex(self, place: Floats) -> Floats:
        """The paths of both directions at (delay, corner), (N, 2)."""
        return self.band.apply(self._path(float(place[0]), float(place[1])), self.rate_hz)

    def solve(self, design: Floats) -> Floats:
        """Plain least squares on the fitted rows."""
        return np.asarray(
            np.linalg.lstsq(design[self.rows], self.target[self.rows], rcond=None)[0], dtype=np.float64
        )

    def left(self, design: Floats) -> Floats:
        """What it leaves of the fitted rows."""
        rest: Floats = self.target[self.rows] - design[self.rows] @ self.solve(design)
        return rest

    def vaf(self, design: Floats) -> float:
        """On the rows held out, %."""
        rest = self.target[self.held] - design[self.held] @ self.solve(design)
        return float(100 * (1 - np.var(rest) / np.var(self.target[self.held])))

    def linear(self, design: Floats, names: tuple[str, ...], ar_order: int = _AR_ORDER) -> Estimate:
        """With intervals for coloured noise."""
        rows = Stretch(design[self.rows][:, None, :], self.target[self.rows][:, None])
        return fit_linear([rows], names, ("",) * len(names), ar_order=ar_order)

    def coarse(self) -> Floats:
        """The best place of a grid."""
        grid = [np.array([delay, corner]) for delay in DELAYS_S for corner in CORNERS_RAD_S]

        def cost(at: Floats) -> float:
            return float(np.sum(self.left(np.column_stack([self.base, self.reflex(at)])) ** 2))

        return min(grid, key=cost)

    def refined(self, place: Floats) -> tuple[Floats, Estimate]:
        """Gauss and Newton's steps from a place of the grid, and the estimate of all at their end."""
        bounds = np.array([DELAY_S, CORNER_RAD_S])
        gain = self.solve(np.column_stack([self.base, self.reflex(place)]))[4:]
        estimate: Estimate | None = None
        for turn in range(_STEPS):
            slopes = [self._slope(place, k) @ gain for k in range(2)]
            design = np.column_stack([self.base, self.reflex(place), *slopes])
            coloured = turn >= _PLAIN_STEPS
            estimate = self.linear(design, _NAMES, _AR_ORDER if coloured else 0)
            step = np.clip(estimate.value[6:], [-0.01, -0.3 * place[1]], [0.01, 0.3 * place[1]])
            place = np.clip(place + step, bounds[:, 0], bounds[:, 1])
            gain = estimate.value[4:6]
            if coloured and np.all(np.abs(step) < 0.02 * estimate.sd[6:]):
                break
        assert estimate is not None
        return place, estimate

    def _slope(self, place: Floats, k: int) -> Floats:
        """d reflex / d delay or corner, (N, 2)."""
        step = np.zeros(2)
        step[k] = (5e-4, 0.01 * place[1])[k]
        result: Floats = (self.reflex(place + step) - self.reflex(place - step)) / (2 * step[k])
        return result

    def p_value(self, place: Floats) -> float:
        """Of the largest gain over all delays and muscles; its null distribution is drawn.

        Rows are whitened by the colour that the reflex at `place` leaves. Delay and muscle mean nothing
        without a reflex: each place of the grid has two scores, all of them normal, with a covariance that is
        known.
        """
        rich = np.column_stack([self.base, self.reflex(place)])
        root = np.linalg.cholesky(_spd(np.linalg.inv(rich[self.rows].T @ rich[self.rows])))
        rest = self.left(rich)
        residual = np.column_stack([rest, rich[self.rows] @ root * float(np.std(rest))])
        colour = colour_of([residual[:, None, :] / max(float(np.std(rest)), 1e-300)], _AR_ORDER)
        grid = [np.array([delay, corner]) for delay in DELAYS_S for corner in CORNERS_RAD_S]
        paths = np.concatenate([self.reflex(at) for at in grid], axis=1)
        every = np.column_stack([self.target, self.base, paths])[self.rows]
        white = colour.whitened([every[:, None, :]])[0][:, 0]
        y, X, Z = white[:, 0], white[:, 1:5], white[:, 5:]
        orthogonal = np.linalg.qr(X)[0]
        y, Z = y - orthogonal @ (orthogonal.T @ y), Z - orthogonal @ (orthogonal.T @ Z)
        Z = Z / np.linalg.norm(Z, axis=0)
        at = 2 * int(np.argmin([np.sum((g - place) ** 2 / np.array([0.01, 5.0]) ** 2) for g in grid]))
        own = np.linalg.lstsq(Z[:, at : at + 2], y, rcond=None)[0]
        spread = float(np.sum((y - Z[:, at : at + 2] @ own) ** 2)) / (len(y) - 6)
        C = Z.T @ Z
        size, axes = np.linalg.eigh(C)
        drawn = (
            np.random.default_rng(0).normal(size=(_DRAWS, len(C))) @ (axes * np.sqrt(np.maximum(size, 0))).T
        )
        gains = _gains(C, np.concatenate([(Z.T @ y)[None] / np.sqrt(spread), drawn]))
        return float((1 + np.sum(gains[1:] >= gains[0])) / (1 + _DRAWS))


def _gains(C: Floats, scores: Floats) -> Floats:
    """The largest s' C^-1 s over pairs of columns, (n, 2 k) -> (n,)."""
    pairs = [slice(k, k + 2) for k in range(0, len(C), 2)]
    every = [
        np.einsum("ni,ij,nj->n", scores[:, p], np.linalg.inv(_spd(C[p, p])), scores[:, p]) for p in pairs
    ]
    result: Floats = np.max(every, axis=0)
    return result


def _spd(matrix: Floats) -> Floats:
    result: Floats = 0.5 * (matrix + matrix.T) + 1e-12 * np.trace(matrix) * np.eye(len(matrix))
    return result
