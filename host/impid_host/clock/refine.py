"""An alignment of two angle logs refined: weighted least squares for offset, rate and a constant per joint.

The velocity in the estimating equation is smoothed. Taken from the raw counts it would carry the same
quantisation noise as the residual, and their product would shift the offset by up to a tenth of a
microsecond.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.clock.lags import FIRST_HALF_WINDOW_S, Motion, smallest_step
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.filters import gaussian
from impid_host.signals.spline import Spline

MAX_DRIFT = 1000e-6
_VELOCITY_SMOOTHING_S = 8e-3
_OUTLIER_SIGMAS = 8.0


@dataclass(frozen=True, slots=True)
class Interpolant:
    """The angle and the smoothed velocity of one log at any time inside it.

    `resolution` is the smallest step that each angle makes: one count, where it is counted; shape (n,).
    """

    motion: Motion
    angle: Spline
    velocity: Floats
    resolution: Floats

    def believable(self, t: Floats) -> Mask:
        """Away from gaps and ends: a spline rings for a few rows beside them."""
        knots, period = self.motion.t, self.motion.period
        right = np.clip(np.searchsorted(knots, t), 3, len(knots) - 3)
        inside = (t > knots[2]) & (t < knots[-3])
        result: Mask = inside & ((knots[right + 2] - knots[right - 3]) < 6.5 * period)
        return result

    def velocity_at(self, t: Floats) -> Floats:
        columns = [np.interp(t, self.motion.t, column) for column in self.velocity.T]
        return np.stack(columns, axis=1)


@dataclass(frozen=True, slots=True)
class Solution:
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

    def normal(self, weight: Floats) -> Floats:
        """Normal matrix of offset, drift and constants under other weights (rows, n)."""
        return _normal(self.design, weight)

    @property
    def score(self) -> float:
        return float(np.sqrt(np.mean(self.residual**2)))


def interpolant_of(log: Motion) -> Interpolant:
    raw = np.gradient(log.theta, log.t, axis=0)
    velocity = gaussian(raw, _VELOCITY_SMOOTHING_S / log.period)
    angle = Spline(log.t, log.theta)
    return Interpolant(log, angle, velocity, smallest_step(log.theta))


def refine(interpolant: Interpolant, robot: Motion, lag: float) -> Solution | None:
    """Grow the fitted stretch from the centre of the overlap, so that the drift never leads it astray."""
    begin = max(0.0, -lag)
    end = min(robot.duration, interpolant.motion.duration - lag)
    centre = 0.5 * (begin + end)
    half = FIRST_HALF_WINDOW_S
    shift, drift = lag + centre, 0.0
    while True:
        solution = gauss_newton(interpolant, robot, centre=centre, half=half, shift=shift, drift=drift)
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


def gauss_newton(
    interpolant: Interpolant, robot: Motion, *, centre: float, half: float, shift: float, drift: float
) -> Solution | None:
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
        normal = _normal(design, weight)
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        if np.linalg.cond(normal / np.outer(scale, scale)) > 1e10:
            return None
        step = np.linalg.solve(normal, np.einsum("kjp,kj->p", design, weight * misfit))
        residual = misfit - design @ step
        weight = _weights(residual, omega, resolution)
        shift, drift = shift + float(step[0]), drift + float(step[1])
        if abs(step[0]) < 1e-9 and abs(step[1]) < 1e-11:
            break
    return Solution(
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


def _normal(design: Floats, weight: Floats) -> Floats:
    rows = design.reshape(-1, design.shape[2])
    result: Floats = (rows * weight.reshape(-1, 1)).T @ rows
    return result


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
