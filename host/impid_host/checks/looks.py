"""What a look at one channel shows: flat tops, dead channels, joints at rest, wraps, the same data twice."""

from collections.abc import Iterator

import numpy as np

from impid_host.checks.axes import axis_map
from impid_host.checks.check import Check
from impid_host.checks.equations import Motions, low, turned
from impid_host.checks.force_instant import force_instants
from impid_host.checks.signals import Signals, jumps
from impid_host.samples import DeviceSamples
from impid_host.signals.align import robot_rows
from impid_host.signals.arrays import Floats
from impid_host.study.model import Study, Trial

# A share of rows at one end of a channel, and how often its neighbours' number, that no motion gives.
_CLIPPED_SHARE = 0.004
_CLIPPED_TIMES = 8.0
_STRAY = 0.001
RESTS = 2e-3
_SILENT = 0.1  # m/s^2: what noise, tilt and warm-up of a sensor at rest stay below
_ALIKE_SHARE = 0.5
_ANGLES = "impid-host fit --acceleration angles"


def looks(study: Study, signals: Signals, motions: Motions) -> Iterator[Check]:
    """Everything that needs no model but the channel itself."""
    yield from _clipped_accelerometer(study)
    yield from _clipped_torques(study)
    yield from _dead(signals, motions)
    yield from _wraps(signals)
    yield from _resting(study, signals)
    yield from _repeated(study)
    yield from _times(study, signals)
    yield from force_instants(study)


def flat_share(values: Floats) -> float:
    """Share of rows (N,) that pile up at the ends of a channel's range; 0 where they do not."""
    ends = 0.0
    step = _grain(values)
    # A few readings far outside would make everything else one end.
    lowest, highest = np.quantile(values, (_STRAY, 1 - _STRAY)) if len(values) else (0.0, 0.0)
    values = np.clip(values, lowest, highest)
    span = float(highest - lowest)
    if step <= 0 or span < 20 * step or len(values) < 200:
        return 0.0
    width = max(step, span / 400)
    for edge in (values - values.min(), values.max() - values):
        at_end = np.count_nonzero(edge < width)
        beside = np.count_nonzero((edge >= width) & (edge < 11 * width)) / 10
        share = at_end / len(values)
        if share > _CLIPPED_SHARE and at_end > _CLIPPED_TIMES * max(beside, 1.0):
            ends += share
    return float(ends)


def _grain(values: Floats) -> float:
    """Smallest step of a channel."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-12 * max(float(np.abs(values).max()), 1e-300)]
    return float(steps.min()) if len(steps) else 0.0


def _clipped_accelerometer(study: Study) -> Iterator[Check]:
    sensor = study.setup.accelerometer
    shares: dict[str, list[float]] = {}
    for trial in study.trials:
        readings = None if sensor is None else _readings(trial)
        if readings is None:
            continue
        for axis, codes in zip("xy", readings.T, strict=True):
            shares.setdefault(axis, []).append(flat_share(codes.astype(np.float64)))
    clipped = {axis: max(values) for axis, values in shares.items() if max(values) > 0}
    if clipped:
        where = "sensor" if len(clipped) == 2 else next(iter(clipped))
        share = max(clipped.values())
        yield Check(
            "accel.clipped",
            where,
            "contradiction",
            f"the accelerometer's readings have flat tops: up to {100 * share:.1f} % of a trial's samples "
            "lie at one end of its range, whatever the motion",
            {"share": share},
            f"record again with a wider range or a slower motion; until then: {_ANGLES}",
        )


def _readings(trial: Trial) -> Floats | None:
    """What the sensor gave, codes or m/s^2, (N, 2)."""
    device = trial.device
    if device is None:
        return None
    if isinstance(device, DeviceSamples):
        return np.stack([device.ax, device.ay], axis=1).astype(np.float64)
    given = device.codes if device.codes is not None else device.acceleration
    return None if given is None else given.astype(np.float64)


def _clipped_torques(study: Study) -> Iterator[Check]:
    for joint in range(study.trials[0].robot.tau.shape[1]):
        shares = [
            flat_share(trial.robot.tau[:, joint])
            for trial in study.trials
            if len(trial.robot) and np.isfinite(trial.robot.tau[:, joint]).all()
        ]
        if shares and max(shares) > 0:
            yield Check(
                "torque.clipped",
                f"joint{joint + 1}",
                "contradiction",
                f"tau{joint + 1} has flat tops: up to {100 * max(shares):.1f} % of a trial's rows lie at one "
                "end of its range, so that the drive or the log saturates",
                {"share": max(shares)},
                "record again with a slower motion, or raise the limit of the drive (or of the log)",
            )


def _dead(signals: Signals, motions: Motions) -> Iterator[Check]:
    """An axis that says nothing where the encoders say that it must."""
    reading, expected = [], []
    for trial in signals.trials:
        motion = motions.of(trial, signals)
        if trial.acceleration is not None and motion.felt is not None:
            reading.append(low(trial.acceleration))
            expected.append(turned(motion.felt[signals.mount], -signals.mount_angle))
    if not reading:
        return
    read, told = np.concatenate(reading), np.concatenate(expected)
    size, must = np.std(read, axis=0), np.std(told, axis=0)
    found = axis_map(read, told)
    # A reading in another unit is small as well, but follows the motion.
    dead = [
        a
        for a in range(2)
        if size[a] < min(0.02 * must.max(), _SILENT)
        and must.max() > 0.05
        and (found is None or found.left[a] > 0.8)
    ]
    if (dead and size.max() > 0.1 * must.max()) or len(dead) == 2:
        yield Check(
            "accel.dead",
            "sensor" if len(dead) == 2 else "xy"[dead[0]],
            "contradiction",
            f"the accelerometer's {' and '.join('xy'[axis] for axis in dead)} axis shows {size[dead[0]]:.2g} "
            f"m/s^2 where the encoders show {must.max():.2g}",
            {"rms_accelerometer": size[dead[0]], "rms_encoders": must.max()},
            f"check the sensor's supply and cable and record again; until then: {_ANGLES}",
        )


def _wraps(signals: Signals) -> Iterator[Check]:
    seen: dict[tuple[str, int], float] = {}
    for trial in signals.trials:
        for side, joint, size in trial.wraps:
            seen.setdefault((side, joint), size)
    for (side, joint), size in seen.items():
        unit = "counts" if side == "module" else ("rad" if size < 7 else "deg")
        name = f"enc{joint + 1} of the module" if side == "module" else f"the controller's theta{joint + 1}"
        yield Check(
            "angle.wrap",
            f"joint{joint + 1}",
            "contradiction",
            f"{name} jumps back by {size:.6g} {unit} again and again: the counter wraps",
            {"size": size, "unit": unit},
            "device.csv: join the counter across its wraps (a counter of 32 bits is joined by itself)"
            if side == "module"
            else f"robot.csv: join theta{joint + 1} across its wraps (numpy.unwrap) before it is imported",
        )


def _resting(study: Study, signals: Signals) -> Iterator[Check]:
    for joint in range(signals.model.joints):
        logged = [float(np.ptp(trial.angles[:, joint])) for trial in signals.trials]
        counted = [
            float(np.ptp(trial.counted[:, joint]))
            for trial in signals.trials
            if trial.counted is not None and joint < trial.counted.shape[1]
        ]
        if not logged:
            continue
        for trial, span, other in zip(
            signals.trials, logged, counted if len(counted) == len(logged) else logged, strict=True
        ):
            if min(span, other) > RESTS or max(span, other) <= RESTS:
                continue
            side = "module's encoder" if other < span else "controller's angle"
            yield Check(
                "angle.resting",
                f"{trial.name}+joint{joint + 1}",
                "contradiction",
                f"the {side} of joint {joint + 1} does not move in {trial.name}, while the other log shows "
                f"{max(span, other):.2g} rad",
                {"controller": span, "module": other},
                f"check the plug of encoder {joint + 1} and record again",
            )
        still = [
            trial.name
            for trial, span in zip(signals.trials, logged, strict=True)
            if span <= RESTS and np.ptp(trial.theta[:, joint]) <= RESTS
        ]
        if still and len(still) == len(logged):
            yield Check(
                "angle.resting",
                f"joint{joint + 1}",
                "suspect",
                f"joint {joint + 1} does not move in any trial ({study.name})",
                {"span": max(logged)},
                f"record trials in which joint {joint + 1} moves",
            )


def _repeated(study: Study) -> Iterator[Check]:
    rows = [_rows(trial) for trial in study.trials]
    for i, first in enumerate(study.trials):
        for j in range(i):
            shared = len(rows[i] & rows[j])
            least = min(len(rows[i]), len(rows[j]))
            if least >= 50 and shared > _ALIKE_SHARE * least:
                other = study.trials[j]
                yield Check(
                    "trial.repeated",
                    f"{other.name}+{first.name}",
                    "contradiction",
                    f"{first.name} holds the same measured rows as {other.name} ({100 * shared / least:.0f} "
                    "%)",
                    {"share": shared / least},
                    f"remove {first.name}, or put its own recording there: the same data twice make "
                    "intervals too narrow",
                )


def _rows(trial: Trial) -> set[bytes]:
    """Angles and torques row by row, where the joints move; two recordings share next to none."""
    theta, tau = trial.robot.theta, trial.robot.tau
    if len(theta) < 3:
        return set()
    moves = np.concatenate([[False], np.any(np.diff(theta, axis=0) != 0, axis=1)])
    some = np.flatnonzero(moves & np.any(tau != 0, axis=1))[::5]
    whole = np.ascontiguousarray(np.concatenate([theta, tau], axis=1)[some])
    return {row.tobytes() for row in whole}


def _times(study: Study, signals: Signals) -> Iterator[Check]:
    jumped: list[tuple[str, int, float, float]] = []
    for trial in study.trials:
        log = robot_rows(trial.robot)
        rows = jumps(log).tolist() if len(log) > 1 else []
        if rows:
            row = rows[0]
            jumped.append((trial.name, row + 2, float(log.t[row - 1]), float(log.t[row])))
    if jumped:
        said = "; ".join(
            f"{name}: from {a:.6g} to {b:.6g} s before row {row} of robot.csv" for name, row, a, b in jumped
        )
        yield Check(
            "time.jump",
            "+".join(name for name, *_ in jumped),
            "impossible",
            f"the robot's clock jumps ({said})",
            {name: {"row": row, "seconds": b - a} for name, row, a, b in jumped},
            "robot.csv: put what follows the jump into a trial of its own",
        )
    yield from _stamps(study)
    yield from unmatched(study, signals)
    factors = {trial.time_factor for trial in signals.trials}
    for factor in sorted(factors - {1.0}):
        names = [trial.name for trial in signals.trials if trial.time_factor == factor]
        unit = factor in (1e-3, 1e-6, 1e3, 1e6)
        yield Check(
            "time.unit" if unit else "time.rate",
            "+".join(names) if len(names) < len(signals.trials) else "",
            "contradiction",
            f"the robot's clock runs at {1 / factor:.4g} times the module's: "
            + ("t is not in seconds" if unit else "its rows were stamped with another rate than they have"),
            {"factor": factor},
            f'robot.csv, or the mapping it is imported by: t = {{ column = "...", scale = {factor:.6g} }}',
        )


def unmatched(study: Study, signals: Signals) -> Iterator[Check]:
    """Trials whose logs have too little time in common to be put on one clock."""
    known = {trial.name for trial in signals.trials}
    for trial in study.trials:
        device, log = trial.device, robot_rows(trial.robot)
        if trial.name in known or device is None or len(device) < 100 or len(log) < 40:
            continue
        module, robot = float(np.ptp(device.t_us)) * 1e-6, float(np.ptp(log.t))
        units = [k for k in (1e-6, 1e-3, 1e3, 1e6) if module > 0 and 0.3 < module / (robot * k) < 3.0]
        if not units and 0.5 < module / max(robot, 1e-9) < 2.0:
            continue  # merely short
        yield Check(
            "time.unit" if units else "clocks.disagree",
            trial.name,
            "contradiction",
            f"{trial.name}: by its own clock the module's log lasts {module:.4g} s, the robot's {robot:.4g}",
            {"module_s": module, "robot_s": robot},
            f"{trial.name}: check the units of t_us in device.csv (us) and of t in robot.csv (s)"
            if units
            else f"{trial.name}: check that device.csv and robot.csv are of one trial",
        )


def _stamps(study: Study) -> Iterator[Check]:
    """Stamps that the reader put back on the clock of the rows."""
    by_kind: dict[str, list[Trial]] = {}
    for trial in study.trials:
        if trial.robot.stamps is not None:
            by_kind.setdefault(trial.robot.stamps.found, []).append(trial)
    for kind, trials in by_kind.items():
        names = [trial.name for trial in trials]
        fits = [fit for trial in trials if (fit := trial.robot.stamps) is not None]
        how = "stamped several together" if kind == "bursts" else "stamped in coarse steps"
        yield Check(
            f"time.{kind}",
            "+".join(names) if len(names) < len(study.trials) else "",
            "suspect",
            f"the robot's rows were {how} ({fits[0].rows_per_step:.0f} to a step of "
            f"{1e3 * fits[0].step_s:.3g} ms); on a clock of {1e3 * fits[0].period_s:.4g} ms",
            {"residual_rms_s": max(fit.residual_rms_s for fit in fits)},
            "let the controller stamp each row when it is measured, to the microsecond",
        )
