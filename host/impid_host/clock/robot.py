"""Offset and drift between the module's clock and the robot's, from the angles that both of them log.

The module counts the same encoders that the robot's controller reads, so the two logs show one motion on two
clocks. Three steps: the normalised cross-correlation of the velocities finds every alignment worth a try,
whatever the offset; a weighted least-squares fit of offset and rate (and of one constant per joint, since
the controller may round its angle otherwise than the module) refines each; the alignment with the smallest
residual wins, if it wins clearly.
"""

from dataclasses import dataclass, replace

import numpy as np

from impid_host.clock.lags import Motion, coarse_lags, smallest_step
from impid_host.clock.refine import Solution, interpolant_of, polished, refine
from impid_host.errors import UndeterminedError
from impid_host.signals.arrays import Floats
from impid_host.signals.quantiles import student_975

# At 2 Hz a millisecond is 1.3 % of a cycle: damping would show it.
WIDEST_S = 1e-3
_CLEARLY_FASTER = 0.7
_COMPETING_ROWS = 4000
_CLEAR_WIN = 2.0
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
        return float(student_975(self.dof) * np.sqrt(self.covariance[index, index]))


def match_clocks(
    t_device_s: Floats,
    theta_device: Floats,
    t_robot_s: Floats,
    theta_robot: Floats,
    *,
    widest_s: float = WIDEST_S,
) -> RobotClockFit:
    """Fit offset and drift of the module's clock against the robot's from their two angle logs.

    Args:
        t_device_s: module times, s, strictly increasing, shape (N,).
        theta_device: angles from the module's counters, unwrapped, shape (N, n), rad (or m).
        t_robot_s: robot times, s, strictly increasing, shape (M,); rows may be missing or late.
        theta_robot: the controller's angles, shape (M, n), same unit.
        widest_s: widest 95 % interval of the offset that is accepted, s.

    Raises:
        UndeterminedError: too little motion, no common motion, or a motion that repeats itself so that
            several offsets fit equally well.
    """
    if len(t_device_s) < 100 or len(t_robot_s) < 100:
        raise UndeterminedError("fewer than 100 rows in one of the two logs; the clocks cannot be matched")
    device = Motion(t_device_s - t_device_s[0], theta_device)
    robot = Motion(t_robot_s - t_robot_s[0], theta_robot)
    for name, log in (("module", device), ("robot", robot)):
        _require_motion(name, log)
    if robot.period < _CLEARLY_FASTER * device.period:
        best, resolution = _best_alignment(robot, device)
        fit = _turned(_as_fit(best, resolution, start_s=(float(t_device_s[0]), float(t_robot_s[0]))))
    else:
        best, resolution = _best_alignment(device, robot)
        fit = _as_fit(best, resolution, start_s=(float(t_robot_s[0]), float(t_device_s[0])))
    low, high = fit.offset_ci95_s
    if not high - low < widest_s:
        raise UndeterminedError(
            f"the motion leaves the clock offset open by {(high - low) * 1e3:.3g} ms; "
            "record a trial in which the joints move faster or farther"
        )
    return fit


def _best_alignment(knots: Motion, rows: Motion) -> tuple[Solution, Floats]:
    """The rows of one log on the interpolated other, the faster; and the resolution of the latter's angles.

    Candidates compete on a part of the rows, which tells them apart as well; all rows refine the winner.
    """
    interpolant = interpolant_of(knots)
    few = rows.fewer(_COMPETING_ROWS)
    solutions = [refine(interpolant, few, lag) for lag in coarse_lags(knots, rows)]
    first = _clear_winner([solution for solution in solutions if solution is not None])
    best = polished(interpolant, rows, first)
    return (first if best is None else best), interpolant.resolution


def _as_fit(best: Solution, resolution: Floats, *, start_s: tuple[float, float]) -> RobotClockFit:
    """The fit as if the interpolated log were the module's; `start_s`: first stamps of the rows and of it."""
    covariance, dof = _covariance(best, resolution)
    return RobotClockFit(
        robot_ref_s=start_s[0] + best.centre_robot,
        device_ref_s=start_s[1] + best.centre_device,
        drift=best.drift,
        covariance=covariance,
        dof=dof,
        overlap_s=float(best.rows[-1] - best.rows[0]),
        rows_used=len(best.rows),
        rows_rejected=best.rejected,
        residual_rms=np.sqrt(np.mean(best.residual**2, axis=1)),
        angle_offset=best.constants,
    )


def _turned(fit: RobotClockFit) -> RobotClockFit:
    """The same match with the clocks' places exchanged; a small drift leaves the covariance as it is."""
    return replace(
        fit,
        robot_ref_s=fit.device_ref_s,
        device_ref_s=fit.robot_ref_s,
        drift=1.0 / (1.0 + fit.drift) - 1.0,
        angle_offset=-fit.angle_offset,
    )


def _require_motion(name: str, log: Motion) -> None:
    few = log.fewer(_COMPETING_ROWS).theta
    if np.any(few.max(axis=0) - few.min(axis=0) > 20 * smallest_step(log.theta)):
        return
    raise UndeterminedError(
        f"the {name}'s angles hardly move; matching the clocks needs a motion of the joints, "
        "also check that the encoders are connected"
    )


def _clear_winner(solutions: list[Solution]) -> Solution:
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


def _covariance(best: Solution, resolution: Floats) -> tuple[Floats, float]:
    """Block sandwich: counting errors of a slow motion hang together; at least the counting noise."""
    scores = best.scores()
    count = int(np.clip((best.rows[-1] - best.rows[0]) / _BLOCK_S, 8, 400))
    edges = np.linspace(best.rows[0], best.rows[-1], count + 1)
    starts = np.searchsorted(best.rows, edges[:-1])
    total = np.concatenate([np.zeros_like(scores[:, :1]), np.cumsum(scores, axis=1)], axis=1)
    sums = np.diff(total[:, np.append(starts, scores.shape[1])], axis=1)
    normal = best.normal(best.weight)
    parameters = normal.shape[0]
    inverse = np.linalg.inv(normal)
    covariance = inverse @ (sums @ sums.T) @ inverse * (count / (count - parameters))
    counted = np.where(np.isfinite(resolution), resolution, 0.0) ** 2 / 6
    floor = np.linalg.inv(best.normal((best.weight > 0) / np.maximum(counted, 1e-300)[:, None]))
    stretch = np.sqrt(np.maximum(np.diag(floor) / np.diag(covariance), 1.0))[:2]
    return covariance[:2, :2] * np.outer(stretch, stretch), float(count - parameters)
