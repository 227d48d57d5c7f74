"""Stamps that were not taken with the rows are put back on the rows' own clock; a clock that jumps is found.

A controller samples by its own timer, but many logs are stamped where they are written: when a packet of rows
arrives (all of them at once), or with a coarse clock. The rows are still one period apart: row k was taken at

    t = start + period * (k + rows missing before it)

and its stamp is later by what the row waited, or rounded. A straight line through the stamps over the row
numbers is that clock; rows lost on the way show as steps of whole periods in what the line leaves. The line
stands in for the stamps only where it explains them: what it leaves must stay within about one step of them.
Where the motion was logged beside them, it is a witness: what moves on by two rows' way in a step of double
length shows that a row is missing there, and that the stamps are good.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impid_host.signals.arrays import Floats, Mask
from impid_host.study.model import StampFit

Ints = NDArray[np.intp]

_FEWEST_ROWS = 100
# Rows to a stamp below which a log merely repeats one here and there.
_FEWEST_PER_STEP = 1.3
# Stamps on either side whose medians tell a lost row from the jitter of arrivals; odd.
_LEVEL = 9
# Rise of that level, in periods, by which a row is missing, and in standard deviations of the jitter.
_LOST, _LOST_SIGMAS = 0.7, 2.3
# What the clock may leave, in steps of the stamps on either side of the middle; half of one is exact.
_EXPLAINED = 0.65
# Stamps within this part of a period of a uniform clock are good as they are.
_GOOD = 0.02
# A log whose steps have more different lengths is not stamped in multiples of one.
_MOST_LENGTHS = 64
_WINDOWS_TICK_S = 1 / 64
# Rows on either side of one whose mean way tells its own; and how much the ways must tell: a standard error
# of a quarter of what is asked.
_AROUND = 3
_TELLS = 16.0


@dataclass(frozen=True, slots=True)
class _Stamped:
    """The stamps there are, in order: `t` (K,), s, and the number of the last row of each, (K,).

    They are `step_s` apart, hardly ever more than `longest_s`.
    """

    t: Floats
    row: Ints
    step_s: float
    longest_s: float


@dataclass(frozen=True, slots=True)
class _Clock:
    """t = start_s + period_s * (row + missing); rows missing before each stamp, (K,)."""

    start_s: float
    period_s: float
    missing: Floats


def recovered(t: Floats, motion: Floats | None = None) -> tuple[Floats, StampFit] | None:
    """Times on the rows' own clock, (N,), s, and how it explains the stamps `t` (N,), which never decrease.

    None where the stamps are good as they are, or no uniform clock explains them.

    Args:
        motion: something smooth that was logged in the same rows, as angles, (N, n).
    """
    if len(t) < _FEWEST_ROWS or (motion is not None and moves_by(t, motion) > 0.5):
        return None
    stamped = _in_bursts(t) or _in_coarse_steps(t)
    if stamped is None or len(stamped.t) < 2 * _LEVEL + 2:
        return None
    clock = _clock_of(stamped)
    numbers = np.arange(len(t))
    # A burst brings the rows up to its last: what it lacks is taken as lost before it.
    before = clock.missing[np.searchsorted(stamped.row, numbers)]
    times = clock.start_s + clock.period_s * (numbers + before)
    left = t - times
    middle = 0.5 * (np.quantile(left, 0.005) + np.quantile(left, 0.995))
    spread = np.abs(left - middle)
    per_stamp = len(t) / len(stamped.t)
    if np.quantile(spread, 0.99) > _EXPLAINED * stamped.longest_s or np.std(left) < _GOOD * clock.period_s:
        return None
    coarse = per_stamp == 1.0 or _is_coarse_clock(t, stamped.step_s)
    # A rounded stamp is as often early as late; one of an arrival is never early.
    shift = float(np.mean(left)) if coarse else float(np.quantile(left, 0.005))
    fit = StampFit(
        found="resolution" if coarse else "bursts",
        period_s=clock.period_s,
        step_s=stamped.step_s,
        rows_per_step=per_stamp,
        residual_rms_s=float(np.std(left)),
        residual_max_s=float(np.max(np.abs(left - np.mean(left)))),
        missing_rows=int(clock.missing[-1]),
    )
    return times + shift, fit


def moves_by(t: Floats, motion: Floats) -> float:
    """How far what is logged moves on with the stamps' steps: 1 with the stamps, 0 with the rows.

    The way of each row against the mean way of a row around it, times by how much the row's step is longer or
    shorter than the mean step around it. 0 too where nothing moves, or no step differs, or it cannot be told.

    Args:
        t: stamps (N,), s; motion: angles beside them, (N, n).
    """
    way, step = np.diff(motion, axis=0), np.diff(t)
    around = np.concatenate([np.ones(_AROUND), [0.0], np.ones(_AROUND)]) / (2 * _AROUND)
    usual_step = np.convolve(step, around, mode="valid")
    usual = np.stack([np.convolve(own, around, mode="valid") for own in way.T], axis=1)
    inner = slice(_AROUND, len(step) - _AROUND)
    longer = step[inner] / np.maximum(usual_step, 1e-12) - 1.0
    regressor, change = usual * longer[:, None], way[inner] - usual
    # A joint counts by how well it tells, whatever its unit: its angles' steps are noise beside its way.
    weight = 1.0 / np.maximum(np.var(change, axis=0), 1e-300)
    information = float(np.sum(weight * np.sum(regressor**2, axis=0)))
    if information < _TELLS:
        return 0.0
    return float(np.sum(weight * np.sum(regressor * change, axis=0))) / information


def _in_bursts(t: Floats) -> _Stamped | None:
    """The bursts, where rows share a stamp or follow each other far more quickly than bursts do."""
    steps = np.diff(t)
    positive = steps[steps > 0]
    if len(positive) == 0:
        return None
    # Rows written one after the other in a burst are microseconds apart, the bursts milliseconds.
    mean = float(np.mean(steps))
    apart = steps > (mean if np.median(positive) < 0.1 * mean else 0.0)
    if len(t) < _FEWEST_PER_STEP * (apart.sum() + 1):
        return None
    last = np.append(np.flatnonzero(apart), len(t) - 1)
    between = np.diff(t[last])
    return _Stamped(t[last], last, float(np.median(between)), float(np.quantile(between, 0.95)))


def _in_coarse_steps(t: Floats) -> _Stamped | None:
    """Every row by itself, where all steps are multiples of one but differ."""
    steps = np.diff(t)
    lengths = np.unique(np.round(steps, 6))
    if not 2 <= len(lengths) <= _MOST_LENGTHS:
        return None
    step_s = float(min(lengths[lengths > 0][0], np.diff(lengths).min()))
    off = np.abs(lengths - step_s * np.round(lengths / step_s))
    if step_s < _GOOD * float(np.mean(steps)) or off.max() > max(2e-6, 1e-3 * step_s):
        return None
    return _Stamped(t, np.arange(len(t)), step_s, step_s)


def _clock_of(stamped: _Stamped) -> _Clock:
    """Period, start and missing rows, by the last row of each stamp, which waited least."""
    apart = max(1, min(20, len(stamped.t) // 4))
    slopes = (stamped.t[apart:] - stamped.t[:-apart]) / (stamped.row[apart:] - stamped.row[:-apart])
    origin = stamped.t[0]
    # One row more or less in a burst may be the beat of two clocks as well as a lost row: the fewest losses
    # that explain the stamps are believed.
    for fewest in (np.inf, 1.5, _LOST):
        period, missing = float(np.median(slopes)), np.zeros(len(stamped.t))
        for _ in range(4):
            level = (stamped.t - origin) / period - stamped.row - missing
            missing = missing + _newly_missing(level, fewest)
            slope, start = np.polyfit(stamped.row + missing, stamped.t - origin, 1)
            period = float(slope)
        waited = (stamped.t - origin - start) / period - stamped.row - missing
        if np.ptp(np.quantile(waited, (0.005, 0.995))) < 1.0 + stamped.longest_s / period / 4:
            break
    return _Clock(float(origin + start), period, missing)


def _newly_missing(level: Floats, fewest: float) -> Floats:
    """Rows missing before each stamp by the steps of a level in periods, (K,) -> (K,) whole numbers."""
    if not np.isfinite(fewest):
        return np.zeros(len(level))
    from scipy import ndimage  # noqa: PLC0415  (slow to import, for stamps that are poor)

    smooth = ndimage.median_filter(level, _LEVEL, mode="nearest")
    half = _LEVEL // 2
    jitter = 1.4826 * float(np.median(np.abs(level - smooth)))
    rise = np.zeros(len(level))
    rise[half + 1 : -half] = smooth[2 * half + 1 :] - smooth[: -2 * half - 1]
    labels, _ = ndimage.label(rise > max(fewest, _LOST_SIGMAS * jitter))
    count = np.zeros(len(level))
    sharp = np.diff(level, prepend=level[:1])
    for place in ndimage.find_objects(labels):
        # The medians step anywhere within half their length; the level itself where the rows are missing.
        near = slice(max(1, place[0].start), place[0].stop)
        count[near.start + int(np.argmax(sharp[near]))] = np.round(rise[near].max())
    result: Floats = np.cumsum(count)
    return result


def _is_coarse_clock(t: Floats, step_s: float) -> bool:
    """Whether stamps are multiples of a step that clocks have (1, 2, 5, 10 ms ..., the 64th of a second)."""
    digits = step_s / 10.0 ** np.floor(np.log10(step_s * (1 + 1e-6)))
    usual = min(abs(digits - d) for d in (1, 2, 5)) < 1e-3 or abs(step_s / _WINDOWS_TICK_S - 1) < 1e-3
    off = np.abs(t / step_s - np.round(t / step_s))
    return bool(usual and np.quantile(off, 0.99) * step_s < max(2e-6, 1e-3 * step_s))


@dataclass(frozen=True, slots=True)
class ClockJump:
    """The row (from 0) before which the clock jumps, by how much (s), and whether motion goes on."""

    row: int
    jump_s: float
    motion_goes_on: bool


# Shorter holes are lost rows, whatever made them.
_SHORTEST_JUMP_S, _SHORTEST_JUMP_PERIODS = 0.1, 20.0
_LONGEST_PAUSE_S = 60.0
_SPEED_OVER_S = 0.02


def clock_jump(t: Floats, theta: Floats) -> ClockJump | None:
    """A step of the stamps (N,) that no time passed in, by the angles (N, n), or that outlasts the whole log.

    A hole in which the robot moved on leaves it elsewhere, at another speed. Where angle and speed of all
    joints go on from one row to the next, it is the clock that jumped.
    """
    steps = np.diff(t)
    if len(steps) < _FEWEST_ROWS:
        return None
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    shortest = max(_SHORTEST_JUMP_S, _SHORTEST_JUMP_PERIODS * usual)
    recorded_s = float(steps[steps <= shortest].sum())
    for row in np.flatnonzero(steps > shortest)[:100] + 1:
        hole_s = float(steps[row - 1])
        if _goes_on(theta, int(row), recorded_s / len(steps), hole_s):
            return ClockJump(int(row), hole_s, True)
        if hole_s > max(_LONGEST_PAUSE_S, recorded_s):
            return ClockJump(int(row), hole_s, False)
    return None


def _goes_on(theta: Floats, row: int, period_s: float, hole_s: float) -> bool:
    rows = max(3, round(_SPEED_OVER_S / period_s))
    before, after = theta[max(0, row - rows) : row], theta[row : row + rows]
    if len(before) < 3 or len(after) < 3:
        return False
    speed_before = (before[-1] - before[0]) / ((len(before) - 1) * period_s)
    speed_after = (after[-1] - after[0]) / ((len(after) - 1) * period_s)
    speed = 0.5 * (np.abs(speed_before) + np.abs(speed_after))
    moved = theta[row] - theta[row - 1]
    allowed = 3 * period_s * speed + 3 * _resolution(theta)
    steady = np.abs(speed_after - speed_before) <= 0.5 * speed + allowed / period_s / rows
    goes_on: Mask = (np.abs(moved) <= allowed) & steady
    moving = speed * hole_s > 20 * allowed
    return bool(goes_on.all() and moving.any())


def _resolution(theta: Floats) -> Floats:
    """Smallest step of each angle, (n,)."""
    steps = np.abs(np.diff(theta[:5000], axis=0))
    smallest: Floats = np.min(np.where(steps > 1e-12, steps, np.inf), axis=0)
    return np.where(np.isfinite(smallest), smallest, 0.0)


def words(stamps: StampFit) -> str:
    """What was found and done, for a warning."""
    how = (
        f"about {stamps.rows_per_step:.1f} rows share a stamp, which comes every {stamps.step_s * 1e3:.4g} ms"
        if stamps.found == "bursts"
        else f"the stamps are rounded to {stamps.step_s * 1e3:.4g} ms"
    )
    lost = f", {stamps.missing_rows} rows missing" if stamps.missing_rows else ""
    return (
        f"{how}; the rows are put on a clock of their own, one per {stamps.period_s * 1e3:.6g} ms{lost}; "
        f"the stamps follow it to {stamps.residual_rms_s * 1e3:.3g} ms rms"
    )
