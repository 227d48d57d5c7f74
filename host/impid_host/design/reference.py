"""Joint references for identifying the robot, chosen among many random ones for what they will tell.

Source: [D] Sec. III-A (ten sinusoids in 0 to 2 Hz per joint over a range of 40 deg, 50 s).
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from impid_host.design.information import Information, information
from impid_host.design.multisine import (
    Harmonics,
    Multisine,
    clip_crest_factor,
    odd_random_harmonics,
    random_phase_multisine,
)
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.arrays import Floats
from impid_host.robot.model import RobotModel

SINUSOIDS = 10
Choose = Callable[[np.random.Generator, int], Multisine]


@dataclass(frozen=True, slots=True)
class Plan:
    """What every reference of one design shares.

    Attributes:
        centre: joint angles to move about (rad), shape (n,).
        range_: peak to peak of each joint (rad), shape (n,).
        period_s: common period of all sinusoids.
        periods: whole steady periods to record.
        fade_s: time to start from rest, and again to come to rest; outside the steady periods.
        fs: rate of the exported reference, Hz.
        speed_limit: largest joint speed (rad/s), shape (n,), or None.
    """

    centre: Floats
    range_: Floats
    period_s: float
    periods: int
    fade_s: float
    fs: float
    speed_limit: Floats | None = None


@dataclass(frozen=True, slots=True)
class JointReference:
    """A motion for the robot's controller to track.

    Attributes:
        t: s, shape (N,), from 0.
        theta: rad, shape (N, n).
        omega: rad/s, shape (N, n).
        theta_dd: rad/s^2, shape (N, n).
        steady: samples of the steady periods, boolean, shape (N,).
        multisines: one per joint.
        period_s: of the multisines.
        information: along the steady periods, for one N m of white torque noise on every joint.
        tried: how many random candidates this one is the best of.
    """

    t: Floats
    theta: Floats
    omega: Floats
    theta_dd: Floats
    steady: np.ndarray[tuple[int], np.dtype[np.bool_]]
    multisines: tuple[Multisine, ...]
    period_s: float
    information: Information
    tried: int

    def __str__(self) -> str:
        crest = ", ".join(f"{m.crest_factor:.2f}" for m in self.multisines)
        low, high = np.rad2deg(self.theta.min(axis=0)), np.rad2deg(self.theta.max(axis=0))
        spans = ", ".join(f"{a:.1f} to {b:.1f}" for a, b in zip(low, high, strict=True))
        speed = ", ".join(f"{v:.2f}" for v in np.abs(self.omega).max(axis=0))
        return (
            f"{self.t[-1]:.1f} s, period {self.period_s:g} s; joints move {spans} deg "
            f"at up to {speed} rad/s; crest factors {crest}; "
            f"condition of the robot's regressor {self.information.condition:.1f}"
        )


def ten_sinusoids(period_s: float, upper_Hz: float = 2.0) -> Choose:
    """[D]'s reference: ten sinusoids of equal amplitude, one at random in each tenth of the band.

    Joints draw their own frequencies, so that they do not move in step.

    Raises:
        UndeterminedError: the period leaves fewer than ten harmonics in the band.
    """
    available = int(np.floor(upper_Hz * period_s + 1e-9))
    if available < SINUSOIDS:
        raise UndeterminedError(
            f"a period of {period_s:g} s has {available} harmonics up to {upper_Hz:g} Hz; ten sinusoids "
            f"need at least {SINUSOIDS / upper_Hz:g} s"
        )
    edges = np.linspace(0, available, SINUSOIDS + 1).round().astype(np.int64)

    def choose(rng: np.random.Generator, _joint: int) -> Multisine:
        harmonics = np.array([rng.integers(low + 1, high + 1) for low, high in pairwise(edges)])
        return clip_crest_factor(rng, period_s, harmonics, np.ones(SINUSOIDS))

    return choose


def odd_random_multisine(period_s: float, upper_Hz: float = 2.0) -> Choose:
    """Odd-random multisine of equal amplitudes and random phases: what the best linear approximation averages
    over.
    """

    def choose(rng: np.random.Generator, _joint: int) -> Multisine:
        harmonics = _odd_harmonics(rng, period_s, upper_Hz)
        return random_phase_multisine(rng, period_s, harmonics, np.ones(len(harmonics)))

    return choose


def low_crest_multisine(period_s: float, upper_Hz: float = 2.0) -> Choose:
    """The same grid with phases of low crest factor: moves the most within the joint limits."""

    def choose(rng: np.random.Generator, _joint: int) -> Multisine:
        harmonics = _odd_harmonics(rng, period_s, upper_Hz)
        return clip_crest_factor(rng, period_s, harmonics, np.ones(len(harmonics)))

    return choose


def _odd_harmonics(rng: np.random.Generator, period_s: float, upper_Hz: float) -> Harmonics:
    harmonics = odd_random_harmonics(rng, period_s, 0.0, upper_Hz)
    if len(harmonics) < 2:
        raise UndeterminedError(
            f"a period of {period_s:g} s has too few odd harmonics up to {upper_Hz:g} Hz; lengthen it"
        )
    return harmonics


def design_reference(
    model: RobotModel, plan: Plan, choose: Choose, *, candidates: int = 50, seed: int = 0
) -> JointReference:
    """The most informative of many random references that respect the limits.

    Args:
        model: of the robot; its regressor judges the candidates.
        plan: what all candidates share.
        choose: makes one joint's multisine, `ten_sinusoids(...)` or `odd_random_multisine(...)`.
        candidates: how many to try.
        seed: of the random choices; the same seed gives the same reference.

    Raises:
        UndeterminedError: no candidate respects the speed limit, or none determines every parameter.
    """
    rng = np.random.default_rng(seed)
    best: JointReference | None = None
    for _ in range(candidates):
        multisines = tuple(_fill_range(choose(rng, j), plan.range_[j]) for j in range(len(plan.centre)))
        reference = _run(model, plan, multisines, candidates)
        too_fast = plan.speed_limit is not None and np.any(
            np.abs(reference.omega).max(axis=0) > plan.speed_limit
        )
        if not too_fast and (best is None or reference.information.log_det > best.information.log_det):
            best = reference
    if best is None:
        raise UndeterminedError(
            f"none of {candidates} references stays below the speed limit; lower the band or the range"
        )
    if not np.isfinite(best.information.log_det):
        raise UndeterminedError("no reference determines every robot parameter; widen the range or the band")
    return best


def _fill_range(multisine: Multisine, range_: float) -> Multisine:
    """The multisine scaled so that it stays within +- range / 2 and touches one end."""
    scale = 0.5 * range_ / np.max(np.abs(multisine.one_period()))
    return Multisine(multisine.period_s, multisine.harmonics, scale * multisine.amplitude, multisine.phase)


def _run(model: RobotModel, plan: Plan, multisines: tuple[Multisine, ...], tried: int) -> JointReference:
    """Fade in from rest at the centre, the steady periods, fade out to rest at the centre."""
    total = 2 * plan.fade_s + plan.periods * plan.period_s
    t = np.arange(round(total * plan.fs) + 1) / plan.fs
    w, w_d, w_dd = _fade(t, plan.fade_s, total)
    x, v, a = (np.stack([m.value(t - plan.fade_s, k) for m in multisines], axis=1) for k in range(3))
    theta = plan.centre + w * x
    omega = w_d * x + w * v
    theta_dd = w_dd * x + 2 * w_d * v + w * a
    steady = (t >= plan.fade_s - 1e-9) & (t < total - plan.fade_s - 1e-9)
    Y = model.regressor(theta[steady], omega[steady], theta_dd[steady])
    return JointReference(
        t,
        theta,
        omega,
        theta_dd,
        steady,
        multisines,
        plan.period_s,
        information(Y, np.ones(Y.shape[1])),
        tried,
    )


def _fade(t: Floats, fade_s: float, total_s: float) -> tuple[Floats, Floats, Floats]:
    """Window 0 to 1 to 0 whose speed and acceleration are continuous (quintic), and its two derivatives, (N,
    1).
    """
    if fade_s <= 0:
        return np.ones((len(t), 1)), np.zeros((len(t), 1)), np.zeros((len(t), 1))
    rising = t < total_s / 2
    s = np.clip(np.where(rising, t, total_s - t) / fade_s, 0.0, 1.0)
    direction = np.where(rising, 1.0, -1.0) / fade_s
    w = s**3 * (10 - 15 * s + 6 * s**2)
    w_d = 30 * s**2 * (1 - s) ** 2 * direction
    w_dd = 60 * s * (1 - s) * (1 - 2 * s) / fade_s**2
    return w[:, np.newaxis], w_d[:, np.newaxis], w_dd[:, np.newaxis]
