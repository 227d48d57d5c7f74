"""An alignment of two angle logs refined: weighted least squares for offset, rate and a constant per joint.

The velocity in the estimating equation is smoothed. Taken from the raw counts it would carry the same
quantisation noise as the residual, and their product would shift the offset by up to a tenth of a
microsecond.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impid_host.clock.lags import FIRST_HALF_WINDOW_S, Motion, smallest_step
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.filters import gaussian
from impid_host.signals.spline import Spline

MAX_DRIFT = 1000e-6
_VELOCITY_SMOOTHING_S = 8e-3
_OUTLIER_SIGMAS = 8.0
_FEWEST_ROWS = 50
_MOST_STEPS = 30
_WORST_CONDITION = 1e10
_ONE_STEP_S = 2e-6

Places = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Interpolant:
    """The angle and the smoothed velocity of one log at any time inside it, joint by joint.

    Attributes:
        angle: through the log's angles.
        velocity: at the log's rows, (n, N).
        sound: for each number of rows before an instant, (N + 1,), whether the angle there is to be believed:
            away from gaps and ends, beside which a spline rings for a few rows.
        resolution: the smallest step that each angle makes: one count, where it is counted; (n,).
    """

    motion: Motion
    angle: Spline
    velocity: Floats
    sound: Mask
    resolution: Floats

    def speed_at(self, t: Floats, before: Places) -> Floats:
        """Velocities, (n, K), at t (K,), each with so many rows before it."""
        knots = self.motion.t
        share = (t - knots[before - 1]) / (knots[before] - knots[before - 1])
        return np.stack([(1 - share) * own[before - 1] + share * own[before] for own in self.velocity])


@dataclass(frozen=True, slots=True)
class Solution:
    """A refined alignment: device = centre_device + (1 + drift)(robot - centre_robot), relative times.

    Of n joints and the K rows that take part: residual, weight and speed, d(misfit)/d(offset), (n, K).
    """

    centre_robot: float
    centre_device: float
    drift: float
    constants: Floats
    residual: Floats
    weight: Floats
    speed: Floats
    rows: Floats
    rejected: int

    def normal(self, weight: Floats) -> Floats:
        """Normal matrix of offset, drift and constants under other weights (n, K)."""
        return _normal(self.speed, self.rows - self.centre_robot, weight)

    def scores(self) -> Floats:
        """Each row's part of the normal equations' right side, (2 + n, K)."""
        pull = self.weight * self.residual
        along = np.sum(pull * self.speed, axis=0)
        return np.stack([along, along * (self.rows - self.centre_robot), *pull])

    @property
    def score(self) -> float:
        return float(np.sqrt(np.mean(self.residual**2)))


def interpolant_of(log: Motion) -> Interpolant:
    """Of a log of ten rows or more."""
    raw = np.gradient(log.theta, log.t, axis=0)
    period = log.period
    velocity = gaussian(raw, _VELOCITY_SMOOTHING_S / period)
    sound = np.zeros(len(log.t) + 1, dtype=bool)
    sound[3 : len(log.t) - 2] = log.t[5:] - log.t[:-5] < 6.5 * period
    return Interpolant(
        log, Spline(log.t, log.theta), np.ascontiguousarray(velocity.T), sound, smallest_step(log.theta)
    )


def refine(interpolant: Interpolant, robot: Motion, lag: float) -> Solution | None:
    """Grow the fitted stretch from the centre of the overlap, so that the drift never leads it astray."""
    begin = max(0.0, -lag)
    end = min(robot.duration, interpolant.motion.duration - lag)
    centre = 0.5 * (begin + end)
    half = FIRST_HALF_WINDOW_S
    shift, drift = lag + centre, 0.0
    while True:
        solution = _settled(interpolant, robot, centre=centre, half=half, shift=shift, drift=drift)
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


def polished(interpolant: Interpolant, robot: Motion, near: Solution) -> Solution | None:
    """All rows, from the solution by a part of them: as a rule one step.

    Those are as many microseconds apart as make a step's error, its square times an acceleration, nothing.
    """
    return _stepped(interpolant, robot, np.inf, near, offset_s=_ONE_STEP_S)


def _settled(
    interpolant: Interpolant, robot: Motion, *, centre: float, half: float, shift: float, drift: float
) -> Solution | None:
    """Steps until they no longer change anything, from an offset that may be milliseconds off."""
    joints = robot.theta.shape[1]
    nothing = np.ones((joints, 0))
    near = Solution(centre, shift, drift, np.zeros(joints), nothing, nothing, nothing, np.zeros(0), 0)
    return _stepped(interpolant, robot, half, near, offset_s=1e-9, drift=1e-11)


def _stepped(
    interpolant: Interpolant,
    robot: Motion,
    half: float,
    near: Solution,
    *,
    offset_s: float,
    drift: float = np.inf,
) -> Solution | None:
    """Steps until one changes offset and drift by less than this."""
    for _ in range(_MOST_STEPS):
        solution = _step(interpolant, robot, half, near)
        if solution is None:
            return None
        moved, turned = solution.centre_device - near.centre_device, solution.drift - near.drift
        if abs(moved) < offset_s and abs(turned) < drift:
            return solution
        near = solution
    return near


def _step(interpolant: Interpolant, robot: Motion, half: float, near: Solution) -> Solution | None:
    """One step of Gauss and Newton on the rows within `half` of the centre.

    Rows keep their weights of last time. Where they are others than last time, they get those of what is left
    of them now, or, first of all, one and the same.
    """
    elapsed = robot.t - near.centre_robot
    t_device = near.centre_device + (1.0 + near.drift) * elapsed
    before = np.searchsorted(interpolant.motion.t, t_device)
    window = np.abs(elapsed) <= half
    rows = window & interpolant.sound[before]
    count = int(np.count_nonzero(rows))
    if count < _FEWEST_ROWS:
        return None
    used = slice(None) if count == len(rows) else rows
    elapsed, t_device, before = elapsed[used], t_device[used], before[used]
    speed = interpolant.speed_at(t_device, before)
    misfit = robot.theta[used].T - interpolant.angle(t_device).T
    weight = near.weight
    if weight.shape != misfit.shape:
        first = near.residual.size == 0
        left = misfit - near.constants[:, None]
        weight = np.ones_like(misfit) if first else _weights(left, speed, interpolant.resolution)
    normal = _normal(speed, elapsed, weight)
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    if np.linalg.cond(normal / np.outer(scale, scale)) > _WORST_CONDITION:
        return None
    pull = weight * misfit
    along = np.sum(pull * speed, axis=0)
    step = np.linalg.solve(normal, np.array([along.sum(), along @ elapsed, *pull.sum(axis=1)]))
    residual = misfit - speed * (step[0] + step[1] * elapsed) - step[2:, None]
    weight = _weights(residual, speed, interpolant.resolution)
    return Solution(
        centre_robot=near.centre_robot,
        centre_device=near.centre_device + float(step[0]),
        drift=near.drift + float(step[1]),
        constants=step[2:],
        residual=residual,
        weight=weight,
        speed=speed,
        rows=robot.t[used],
        rejected=int(np.count_nonzero(window) - np.count_nonzero(np.all(weight > 0, axis=0))),
    )


def _normal(speed: Floats, elapsed: Floats, weight: Floats) -> Floats:
    """Of d(misfit)/d(offset, drift, constant of each joint), speed, speed * elapsed, 1: (2 + n, 2 + n)."""
    n = len(speed)
    result = np.zeros((2 + n, 2 + n))
    for joint in range(n):
        columns = np.stack([speed[joint], speed[joint] * elapsed, np.ones(len(elapsed))])
        own = [0, 1, 2 + joint]
        result[np.ix_(own, own)] += (columns * weight[joint]) @ columns.T
    return result


def _weights(residual: Floats, speed: Floats, resolution: Floats) -> Floats:
    """Inverse variances for an angle noise plus a stamp jitter times speed; a late or stuck row gets none.

    The noise is at least that of the counting: below one count per row most residuals are zero, and the few
    that are not carry all the information. All are (n, K).
    """
    weight = np.empty_like(residual)
    for joint, r in enumerate(residual):
        speed2, r2 = speed[joint] ** 2, r**2
        counting = float(resolution[joint]) / np.sqrt(12) if np.isfinite(resolution[joint]) else 0.0
        spread = max(1.4826 * float(np.median(np.abs(r))), counting, 1e-15)
        core = r2 < (_OUTLIER_SIGMAS * spread) ** 2
        floor, jitter2 = _line(speed2[core], r2[core])
        floor = max(floor, counting**2, 0.02 * float(np.mean(r2[core])), 1e-30)
        variance = floor + max(jitter2, 0.0) * speed2
        pull = r2 / variance / _OUTLIER_SIGMAS**2
        weight[joint] = np.where(pull < 1.0, (1.0 - pull) ** 2, 0.0) / variance
    return weight


def _line(x: Floats, y: Floats) -> tuple[float, float]:
    """Level at zero and slope of the straight line through y over x, by least squares."""
    across = x - x.mean()
    size = float(across @ across)
    slope = float(across @ y) / size if size > 0.0 else 0.0
    return float(y.mean()) - slope * float(x.mean()), slope
