"""Offset and drift between the module's clock and the robot's, from the angles that both of them log.

The module counts the same encoders that the robot's controller reads, so the two logs show one motion on two
clocks. Three steps: the normalised cross-correlation of the velocities finds every alignment worth a try,
whatever the offset; a weighted least-squares fit of offset and rate (and of one constant per joint, since
the controller may round its angle otherwise than the module) refines each; the alignment with the smallest
residual wins, if it wins clearly.

The velocity in the estimating equation is smoothed. Taken from the raw counts it would carry the same
quantisation noise as the residual, and their product would shift the offset by up to a tenth of a
microsecond.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, signal, stats
from scipy.interpolate import CubicSpline

from impid_host.errors import UndeterminedError
from impid_host.signals.arrays import Floats, Mask

MAX_DRIFT = 1000e-6
MIN_OVERLAP_S = 1.0
_COARSE_STEP_S = 5e-3
_FIRST_HALF_WINDOW_S = 30.0
_VELOCITY_SMOOTHING_S = 8e-3
_MIN_CORRELATION = 0.7
_CLEAR_WIN = 2.0
_CANDIDATES = 8
_OUTLIER_SIGMAS = 8.0
_BLOCK_S = 0.5


@dataclass(frozen=True, slots=True)
class RobotClockFit:
    """The module's clock from the robot's: t_device = device_ref + (1 + drift) (t_robot - robot_ref).

    Attributes:
        robot_ref_s, device_ref_s: the same instant on either clock, the centre of the overlap, where offset
            and drift are uncorrelated; s.
        drift: module seconds per robot second, minus one.
        covariance: of (device_ref_s in s, drift), shape (2, 2).
        dof: degrees of freedom behind the covariance.
        overlap_s: length of the common stretch, s of the robot's clock.
        rows_used: robot rows that took part.
        rows_rejected: robot rows inside the overlap left out as outliers or beside a gap.
        residual_rms: rms of the angle residual per joint, rad (m for a prismatic joint), shape (n,).
        angle_offset: robot angle minus module angle per joint, rad (or m), shape (n,).
    """

    robot_ref_s: float
    device_ref_s: float
    drift: float
    covariance: Floats
    dof: float
    overlap_s: float
    rows_used: int
    rows_rejected: int
    residual_rms: Floats
    angle_offset: Floats

    def to_device(self, t_robot_s: Floats) -> Floats:
        """Robot times (s) on the module's clock (s)."""
        return self.device_ref_s + (1.0 + self.drift) * (t_robot_s - self.robot_ref_s)

    def to_robot(self, t_device_s: Floats) -> Floats:
        """Module times (s) on the robot's clock (s)."""
        return self.robot_ref_s + (t_device_s - self.device_ref_s) / (1.0 + self.drift)

    @property
    def offset_s(self) -> float:
        """Module clock minus robot clock at the centre of the overlap, s."""
        return self.device_ref_s - self.robot_ref_s

    @property
    def offset_ci95_s(self) -> tuple[float, float]:
        """95 % interval of the offset, s."""
        half = self._half_width(0)
        return (self.offset_s - half, self.offset_s + half)

    @property
    def drift_ppm(self) -> float:
        """Drift in parts per million; positive when the module's clock runs fast against the robot's."""
        return self.drift * 1e6

    @property
    def drift_ci95_ppm(self) -> tuple[float, float]:
        """95 % interval of the drift, ppm."""
        half = self._half_width(1) * 1e6
        return (self.drift_ppm - half, self.drift_ppm + half)

    def _half_width(self, index: int) -> float:
        return float(stats.t.ppf(0.975, self.dof) * np.sqrt(self.covariance[index, index]))


@dataclass(frozen=True, slots=True)
class _Motion:
    """One log: times from its first row, s, shape (N,), and angles, shape (N, n)."""

    t: Floats
    theta: Floats

    @property
    def period(self) -> float:
        return float(np.median(np.diff(self.t)))

    @property
    def duration(self) -> float:
        return float(self.t[-1])


@dataclass(frozen=True, slots=True)
class _Interpolant:
    """The module's angle and smoothed velocity at any time inside its log."""

    motion: _Motion
    angle: CubicSpline
    velocity: Floats

    def believable(self, t: Floats) -> Mask:
        """Away from gaps and ends: a spline rings for a few rows beside them."""
        knots, period = self.motion.t, self.motion.period
        right = np.clip(np.searchsorted(knots, t), 3, len(knots) - 3)
        inside = (t > knots[2]) & (t < knots[-3])
        result: Mask = inside & ((knots[right + 2] - knots[right - 3]) < 6.5 * period)
        return result

    @property
    def resolution(self) -> Floats:
        """Smallest step that each angle makes: one count, where the angle is counted; shape (n,)."""
        return _smallest_step(self.motion.theta)

    def velocity_at(self, t: Floats) -> Floats:
        columns = [np.interp(t, self.motion.t, column) for column in self.velocity.T]
        return np.stack(columns, axis=1)


@dataclass(frozen=True, slots=True)
class _Solution:
    """A refined alignment: device = centre_device + (1 + drift)(robot - centre_robot), relative times."""

    centre_robot: float
    centre_device: float
    drift: float
    constants: Floats
    residual: Floats
    weight: Floats
    design: Floats
    rows: Floats
    rejected: int

    @property
    def score(self) -> float:
        return float(np.sqrt(np.mean(self.residual**2)))


def match_clocks(
    t_device_s: Floats,
    theta_device: Floats,
    t_robot_s: Floats,
    theta_robot: Floats,
    *,
    widest_s: float | None = None,
) -> RobotClockFit:
    """Fit offset and drift of the module's clock against the robot's from their two angle logs.

    Args:
        t_device_s: module times, s, strictly increasing, shape (N,).
        theta_device: angles from the module's counters, unwrapped, shape (N, n), rad (or m).
        t_robot_s: robot times, s, strictly increasing, shape (M,); rows may be missing or late.
        theta_robot: the controller's angles, shape (M, n), same unit.
        widest_s: widest 95 % interval of the offset that is accepted; None: a period of the module.

    Raises:
        UndeterminedError: too little motion, no common motion, or a motion that repeats itself so that
            several offsets fit equally well.
    """
    if len(t_device_s) < 100 or len(t_robot_s) < 100:
        raise UndeterminedError("fewer than 100 rows in one of the two logs; the clocks cannot be matched")
    device = _Motion(t_device_s - t_device_s[0], theta_device)
    robot = _Motion(t_robot_s - t_robot_s[0], theta_robot)
    _require_motion(device, robot)
    interpolant = _interpolant(device)
    solutions = [
        solution
        for lag in _coarse_lags(device, robot)
        if (solution := _refine(interpolant, robot, lag)) is not None
    ]
    best = _clear_winner(solutions)
    covariance, dof = _covariance(best, interpolant.resolution)
    fit = RobotClockFit(
        robot_ref_s=float(t_robot_s[0] + best.centre_robot),
        device_ref_s=float(t_device_s[0] + best.centre_device),
        drift=best.drift,
        covariance=covariance,
        dof=dof,
        overlap_s=float(best.rows[-1] - best.rows[0]),
        rows_used=len(best.rows),
        rows_rejected=best.rejected,
        residual_rms=np.sqrt(np.mean(best.residual**2, axis=0)),
        angle_offset=best.constants,
    )
    low, high = fit.offset_ci95_s
    if not high - low < (device.period if widest_s is None else widest_s):
        raise UndeterminedError(
            f"the motion leaves the clock offset open by {(high - low) * 1e3:.3g} ms; "
            "record a trial in which the joints move faster or farther"
        )
    return fit


def _require_motion(device: _Motion, robot: _Motion) -> None:
    for name, log in (("module", device), ("robot", robot)):
        span = np.ptp(log.theta, axis=0)
        if not np.any(span > 20 * _smallest_step(log.theta)):
            raise UndeterminedError(
                f"the {name}'s angles hardly move; matching the clocks needs a motion of the joints, "
                "also check that the encoders are connected"
            )


def _smallest_step(theta: Floats) -> Floats:
    steps = np.abs(np.diff(theta, axis=0))
    threshold = 1e-12 * np.max(np.abs(theta), axis=0)
    smallest: Floats = np.min(np.where(steps > threshold, steps, np.inf), axis=0)
    return smallest


def _interpolant(device: _Motion) -> _Interpolant:
    raw = np.gradient(device.theta, device.t, axis=0)
    velocity = ndimage.gaussian_filter1d(raw, _VELOCITY_SMOOTHING_S / device.period, axis=0)
    return _Interpolant(device, CubicSpline(device.t, device.theta, axis=0), velocity)


def _grid_velocity(log: _Motion, step: float) -> Floats:
    grid = np.arange(0.0, log.duration, step)
    theta = np.stack([np.interp(grid, log.t, column) for column in log.theta.T], axis=1)
    smooth = ndimage.gaussian_filter1d(theta, 2.0, axis=0)
    return np.gradient(smooth, step, axis=0)


def _coarse_lags(device: _Motion, robot: _Motion) -> list[float]:
    """Lags (s; robot time plus lag = module time) at which the two velocity signals look alike, best first.

    Of a long robot log only the middle is used here: over hours a drift of 200 ppm would smear the peak.
    """
    step = max(_COARSE_STEP_S, device.period, robot.period)
    fast = _grid_velocity(device, step)
    slow = _grid_velocity(robot, step)
    first = max(0, len(slow) // 2 - int(4 * _FIRST_HALF_WINDOW_S / step))
    slow = slow[first : len(slow) - first]
    shared = min(len(fast), len(slow))
    needed = max(min(MIN_OVERLAP_S / step, 0.8 * shared), 0.05 * shared)

    def correlate(a: Floats, b: Floats) -> Floats:
        result: Floats = signal.fftconvolve(a, b[::-1], axes=0).sum(axis=1)
        return result

    ones = np.ones_like(fast[:, :1]), np.ones_like(slow[:, :1])
    cross = correlate(fast, slow)
    energy = correlate(fast**2, np.ones_like(slow)) * correlate(np.ones_like(fast), slow**2)
    floor = 1e-6 * (np.sum(fast**2) * np.sum(slow**2))
    likeness = np.where(energy > floor, cross / np.sqrt(np.maximum(energy, floor)), 0.0)
    likeness[correlate(*ones) < needed] = 0.0
    peaks, _ = signal.find_peaks(np.concatenate([[0.0], likeness, [0.0]]))
    peaks = peaks - 1
    peaks = peaks[likeness[peaks] > _MIN_CORRELATION]
    if len(peaks) == 0:
        raise UndeterminedError(
            f"module and robot log do not show the same motion (best correlation {likeness.max():.2f}); "
            "check that both belong to one trial, and the encoders' direction and counts_per_rev"
        )
    ranked = peaks[np.argsort(likeness[peaks])[::-1]][:_CANDIDATES]
    return [float((peak - (len(slow) - 1) - first) * step) for peak in ranked]


def _refine(interpolant: _Interpolant, robot: _Motion, lag: float) -> _Solution | None:
    """Grow the fitted stretch from the centre of the overlap, so that the drift never leads it astray."""
    begin = max(0.0, -lag)
    end = min(robot.duration, interpolant.motion.duration - lag)
    centre = 0.5 * (begin + end)
    half = _FIRST_HALF_WINDOW_S
    shift, drift = lag + centre, 0.0
    while True:
        solution = _gauss_newton(interpolant, robot, centre=centre, half=half, shift=shift, drift=drift)
        if solution is None or half >= 0.5 * (end - begin):
            break
        shift, drift, half = solution.centre_device, solution.drift, 2.0 * half
    if (
        solution is None
        or abs(solution.drift) > MAX_DRIFT
        or abs(solution.centre_device - centre - lag) > 1.0
    ):
        return None
    return solution


def _gauss_newton(
    interpolant: _Interpolant, robot: _Motion, *, centre: float, half: float, shift: float, drift: float
) -> _Solution | None:
    window = np.abs(robot.t - centre) <= half
    joints = robot.theta.shape[1]
    weight: Floats = np.ones((0, joints))
    resolution = interpolant.resolution
    for _ in range(30):
        t_device = shift + (1.0 + drift) * (robot.t - centre)
        rows = window & interpolant.believable(t_device)
        if np.count_nonzero(rows) < 50:
            return None
        t_row, t_dev = robot.t[rows], t_device[rows]
        omega = interpolant.velocity_at(t_dev)
        misfit = robot.theta[rows] - interpolant.angle(t_dev)
        design = _design(omega, t_row - centre, joints)
        weight = weight if weight.shape == misfit.shape else np.ones_like(misfit)
        normal = np.einsum("kjp,kj,kjq->pq", design, weight, design)
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        if np.linalg.cond(normal / np.outer(scale, scale)) > 1e10:
            return None
        step = np.linalg.solve(normal, np.einsum("kjp,kj,kj->p", design, weight, misfit))
        residual = misfit - np.einsum("kjp,p->kj", design, step)
        weight = _weights(residual, omega, resolution)
        shift, drift = shift + float(step[0]), drift + float(step[1])
        if abs(step[0]) < 1e-11 and abs(step[1]) < 1e-12:
            break
    return _Solution(
        centre_robot=centre,
        centre_device=shift,
        drift=drift,
        constants=step[2:],
        residual=residual,
        weight=weight,
        design=design,
        rows=t_row,
        rejected=int(np.count_nonzero(window) - np.count_nonzero(np.all(weight > 0, axis=1))),
    )


def _design(omega: Floats, elapsed: Floats, joints: int) -> Floats:
    """d(misfit)/d(offset, drift, constant of each joint), shape (rows, n, 2 + n)."""
    design = np.zeros((len(omega), joints, 2 + joints))
    design[:, :, 0] = omega
    design[:, :, 1] = omega * elapsed[:, None]
    design[:, np.arange(joints), 2 + np.arange(joints)] = 1.0
    return design


def _weights(residual: Floats, omega: Floats, resolution: Floats) -> Floats:
    """Inverse variances for an angle noise plus a stamp jitter times speed; a late or stuck row gets none.

    The noise is at least that of the counting: below one count per row most residuals are zero, and the few
        that
    are not carry all the information.
    """
    weight = np.empty_like(residual)
    for joint in range(residual.shape[1]):
        r, speed2 = residual[:, joint], omega[:, joint] ** 2
        counting = float(resolution[joint]) / np.sqrt(12) if np.isfinite(resolution[joint]) else 0.0
        spread = max(1.4826 * float(np.median(np.abs(r - np.median(r)))), counting, 1e-15)
        core = np.abs(r) < _OUTLIER_SIGMAS * spread
        columns = np.stack([np.ones(int(core.sum())), speed2[core]], axis=1)
        (floor, jitter2), *_ = np.linalg.lstsq(columns, r[core] ** 2, rcond=None)
        jitter2 = max(float(jitter2), 0.0)
        floor = max(float(floor), counting**2, 0.02 * float(np.mean(r[core] ** 2)), 1e-30)
        variance = floor + jitter2 * speed2
        pull = (r**2 / variance) / _OUTLIER_SIGMAS**2
        weight[:, joint] = np.where(pull < 1.0, (1.0 - pull) ** 2, 0.0) / variance
    return weight


def _clear_winner(solutions: list[_Solution]) -> _Solution:
    if not solutions:
        raise UndeterminedError(
            "module and robot log do not show the same motion, or its speed never changes; "
            "check that both belong to one trial"
        )
    ranked = sorted(solutions, key=lambda solution: solution.score)
    best = ranked[0]
    for other in ranked[1:]:
        apart = abs((other.centre_device - other.centre_robot) - (best.centre_device - best.centre_robot))
        if apart > 0.02 and other.score < _CLEAR_WIN * best.score:
            raise UndeterminedError(
                f"the motion repeats itself or keeps one speed: "
                f"offsets {apart:.3f} s apart fit equally well; "
                "start both logs before the motion begins, and vary it"
            )
    return best


def _covariance(best: _Solution, resolution: Floats) -> tuple[Floats, float]:
    """Block sandwich: counting errors of a slow motion hang together; at least the counting noise."""
    scores = np.einsum("kjp,kj,kj->kp", best.design, best.weight, best.residual)
    normal = np.einsum("kjp,kj,kjq->pq", best.design, best.weight, best.design)
    count = int(np.clip((best.rows[-1] - best.rows[0]) / _BLOCK_S, 8, 400))
    edges = np.linspace(best.rows[0], best.rows[-1], count + 1)
    block = np.clip(np.searchsorted(edges, best.rows, side="right") - 1, 0, count - 1)
    sums = np.zeros((count, scores.shape[1]))
    np.add.at(sums, block, scores)
    parameters = normal.shape[0]
    inverse = np.linalg.inv(normal)
    covariance = inverse @ (sums.T @ sums) @ inverse * (count / (count - parameters))
    counted = np.where(np.isfinite(resolution), resolution, 0.0) ** 2 / 6
    used = (best.weight > 0) / np.maximum(counted, 1e-300)
    floor = np.linalg.inv(np.einsum("kjp,kj,kjq->pq", best.design, used, best.design))
    stretch = np.sqrt(np.maximum(np.diag(floor) / np.diag(covariance), 1.0))[:2]
    return covariance[:2, :2] * np.outer(stretch, stretch), float(count - parameters)
