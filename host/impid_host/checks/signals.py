"""A study as the checks see it: every measured channel of every trial on one slow clock, 50 Hz.

Rows are averaged over 10 ms and interpolated. Whatever the setup turns raw numbers into (angles, specific
force) is done already, so that a mistake is a map from one `Signals` to another.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from impid_host.checks.matching import Match, match
from impid_host.checks.wraps import Unwrapped, unwrapped
from impid_host.robot.model import RobotModel, robot_model
from impid_host.samples import DeviceSamples, ModuleSamples, rows_of
from impid_host.signals.align import robot_rows
from impid_host.signals.arrays import Floats
from impid_host.signals.counts import (
    encoder_counts,
    longest_run,
    specific_force,
    unwrap_counts,
    usable_samples,
)
from impid_host.signals.force_timing import as_means
from impid_host.signals.spline import Spline
from impid_host.study.model import EncoderSetup, RobotLog, RobotSetup, Setup, Study, Trial

RATE_HZ = 50.0
LONGEST_S = 60.0
_BIN_S = 0.01
_COUNTERS = (2.0**16, 2.0**12, 2.0**14, 2.0**18, 2.0**20, 2.0**24)
_TURNS = (2 * np.pi, 360.0, np.pi, 180.0, 1.0)
Frame = Literal["base", "link2"]
ChannelMap = Callable[[Floats], Floats]


@dataclass(frozen=True, slots=True)
class TrialSignals:
    """One trial, N instants at 50 Hz; n joints.

    Attributes:
        kind: free, mass-spring or arm (what a stochastic trial shakes).
        angles: the controller's, (N, n); counted: the module's, (N, n), or None.
        torque: (N, n); force: (N, 2) along the sensor's axes, or None.
        acceleration: specific force along the accelerometer's axes, (N, 2), m/s^2, or None.
        time_factor: by which the robot's stamps were taken times to match the module's.
        likeness: of the two logs' velocities, 0 to 1; 1 without a module.
        wraps: of the module's counters, then of the controller's angles, joint by joint; 0 where there was
            none.
    """

    name: str
    kind: str
    load: str
    payload_kg: float | None
    angles: Floats
    counted: Floats | None
    torque: Floats
    force: Floats | None
    acceleration: Floats | None
    time_factor: float = 1.0
    likeness: float = 1.0
    wraps: tuple[tuple[str, int, float], ...] = ()

    @property
    def theta(self) -> Floats:
        """The angles that a fit uses: the module's, where there are any."""
        return self.angles if self.counted is None else self.counted


@dataclass(frozen=True, slots=True)
class Signals:
    """All trials, and of the setup what maps them onto each other."""

    trials: tuple[TrialSignals, ...]
    robot: RobotSetup
    model: RobotModel
    mount: Literal["link2", "fixed"] = "link2"
    mount_angle: float = 0.0
    force_frame: Frame = "base"
    force_angle: float = 0.0
    prior: tuple[float, ...] | None = None
    kinds: frozenset[str] = frozenset()

    @property
    def planar(self) -> bool:
        """Two axes in a plane, where forces and an accelerometer have a direction."""
        return len(self.model.task_axes) == 2

    def mapped(self, **channels: ChannelMap) -> "Signals":
        """Every trial with channels replaced by functions of the trial."""
        return replace(self, trials=tuple(changed(trial, **channels) for trial in self.trials))

    def with_trials(self, trials: tuple[TrialSignals, ...]) -> "Signals":
        """The same apparatus with other trials."""
        return replace(self, trials=trials)

    def with_model(self, name: str) -> "Signals":
        """The same study on another model of the robot."""
        robot = replace(self.robot, model=name)
        return replace(self, robot=robot, model=robot_model(robot))

    def with_lengths(self, lengths: tuple[float, ...]) -> "Signals":
        """The same study on a robot of other link lengths, m."""
        robot = replace(self.robot, link_lengths_m=lengths)
        return replace(self, robot=robot, model=robot_model(robot))


def changed(trial: TrialSignals, **channels: ChannelMap) -> TrialSignals:
    """One trial with arrays replaced by functions of themselves; a channel that is not there stays so."""
    new: dict[str, Any] = {
        name: change(getattr(trial, name))
        for name, change in channels.items()
        if getattr(trial, name) is not None
    }
    return replace(trial, **new)


def signals_of(study: Study) -> Signals:
    """Read every trial onto the slow clock; a trial too short for it is left out."""
    setup = study.setup
    sensor = setup.accelerometer
    force = setup.force_sensor
    trials = _by_whole_wraps(tuple(_trials(study)), setup)
    return Signals(
        trials=trials,
        # A free trial may turn out to be a load's: both kinds of regressors are at hand.
        kinds=frozenset(trial.kind for trial in trials) | {"mass-spring"},
        robot=setup.robot,
        model=robot_model(setup.robot),
        mount="link2" if sensor is None else sensor.mount,
        mount_angle=0.0 if sensor is None else sensor.mount_angle_rad,
        force_frame=force.frame,
        force_angle=force.mount_angle_rad,
        prior=setup.prior_alpha,
    )


def _trials(study: Study) -> Iterator[TrialSignals]:
    for trial in study.trials:
        slow = _slow(trial, study.setup)
        if slow is not None:
            yield slow


@dataclass(frozen=True, slots=True)
class _Module:
    """The module's log: seconds from its first row (M,), angles (M, n), specific force (M, 2), or None."""

    t: Floats
    counted: Floats | None
    acceleration: Floats | None
    wraps: tuple[tuple[str, int, float], ...]


def _module(device: ModuleSamples, setup: Setup, clock: RobotLog) -> _Module | None:
    """The module's longest run; one without angles of its own shares the robot's clock."""
    encoder = setup.encoder
    counts = encoder_counts(device)
    foreign = None if isinstance(device, DeviceSamples) else device.theta
    if len(device) < 100 or (foreign is None and counts is not None and encoder is None):
        return None
    run = rows_of(device, longest_run(device))
    run = rows_of(run, usable_samples(run))
    if len(run) < 100:
        return None
    t = run.t_us.astype(np.float64) * 1e-6
    wraps: list[tuple[str, int, float]] = []
    counted = None
    if foreign is not None and not isinstance(run, DeviceSamples):
        counted = run.theta
    elif counts is not None and encoder is not None:
        counted = _counted(run, encoder, wraps)
    sensor = setup.accelerometer
    force = None
    if sensor is not None and (sensor.reads_codes or not isinstance(run, DeviceSamples)):
        force = specific_force(run, sensor)
        t_felt = t - sensor.delay_s
        force = (
            np.stack([np.interp(t, t_felt, axis) for axis in force.T], axis=1) if sensor.delay_s else force
        )
    start = float(clock.t[0]) if counted is None else float(t[0])
    return _Module(t - start, counted, force, tuple(wraps))


def _counted(run: ModuleSamples, encoder: EncoderSetup, wraps: list[tuple[str, int, float]]) -> Floats:
    """Angles by the counters, joined across wraps; those are noted."""
    columns = []
    for joint, (counter, per_rev, zero, direction) in enumerate(
        zip(
            encoder_counts(run) or (),
            encoder.counts_per_rev,
            encoder.zero_rad,
            encoder.direction,
            strict=False,
        )
    ):
        whole: Unwrapped = unwrapped(unwrap_counts(counter).astype(np.float64), (*_COUNTERS, per_rev))
        if whole.size:
            wraps.append(("module", joint, whole.size))
        columns.append(zero + direction * whole.values * (2 * np.pi / per_rev))
    return np.stack(columns, axis=1)


def _slow(trial: Trial, setup: Setup) -> TrialSignals | None:
    log = as_means(with_forces(unbroken(robot_rows(trial.robot))), setup.force_sensor)
    if len(log) < 40:
        return None
    t = log.t - log.t[0]
    wholes = [unwrapped(column, _TURNS) for column in log.theta.T]
    angles = np.stack([whole.values for whole in wholes], axis=1)
    wraps = tuple(("controller", joint, whole.size) for joint, whole in enumerate(wholes) if whole.size)
    module = None if trial.device is None else _module(trial.device, setup, log)
    both: Match | None = None
    if module is not None and module.counted is not None:
        both = match(module.t, module.counted, t, angles[:, : module.counted.shape[1]])
        wraps += module.wraps
        wraps += tuple(("module", joint, 2.0**16) for joint in trial.narrow_counters)
    elif module is not None:
        both = Match(0.0, 0.0, 1.0, 1.0)
    factor = 1.0 if both is None else both.factor
    begin, end = 0.0, float(t[-1]) * factor
    if both is not None and module is not None:
        scale = 1 + both.drift
        begin = max(begin, -both.offset_s / scale)
        end = min(end, (float(module.t[-1]) - both.offset_s) / scale)
    if end - begin < 2.0:
        return None
    end = min(end, begin + LONGEST_S)
    grid = np.arange(begin, end, 1 / RATE_HZ)
    stamped = t * factor
    logged = _onto(stamped, angles, grid)
    counted = acceleration = None
    if both is not None and module is not None:
        at = both.offset_s + (1 + both.drift) * grid
        counted = None if module.counted is None else _onto(module.t, module.counted, at)
        if module.acceleration is not None and angles.shape[1] == 2:
            acceleration = _onto(module.t, module.acceleration, at)
    return TrialSignals(
        name=trial.name,
        kind=(trial.on or "arm") if trial.kind == "stochastic" else trial.kind,
        load=trial.load,
        payload_kg=trial.payload_kg,
        angles=logged,
        counted=counted,
        torque=_onto(stamped, log.tau, grid),
        force=None if log.force is None else _onto(stamped, log.force, grid),
        acceleration=acceleration,
        time_factor=factor,
        likeness=1.0 if both is None else both.likeness,
        wraps=wraps,
    )


def _by_whole_wraps(trials: tuple[TrialSignals, ...], setup: Setup) -> tuple[TrialSignals, ...]:
    """Where a channel wraps, a trial's first value is open by whole wraps: the other log tells."""
    sizes = {(side, joint): size for trial in trials for side, joint, size in trial.wraps}
    return tuple(_shifted(trial, sizes, setup) for trial in trials) if sizes else trials


def _shifted(trial: TrialSignals, sizes: dict[tuple[str, int], float], setup: Setup) -> TrialSignals:
    if trial.counted is None or setup.encoder is None:
        return trial
    angles, counted = trial.angles.copy(), trial.counted.copy()
    for (side, joint), size in sizes.items():
        if joint >= counted.shape[1]:
            continue
        turn = size if side == "controller" else size * 2 * np.pi / setup.encoder.counts_per_rev[joint]
        whole = turn * np.round(float(np.mean(angles[:, joint] - counted[:, joint])) / turn)
        if side == "controller":
            angles[:, joint] -= whole
        else:
            counted[:, joint] += whole
    return replace(trial, angles=angles, counted=counted)


def jumps(log: RobotLog) -> NDArray[np.intp]:
    """Rows before which the log's clock jumps: by over a second and a hundred periods."""
    steps = np.diff(log.t)
    result: NDArray[np.intp] = np.flatnonzero(steps > max(1.0, 100 * float(np.median(steps)))) + 1
    return result


def unbroken(log: RobotLog) -> RobotLog:
    """The longest stretch without such a jump."""
    if len(log) < 2:
        return log
    edges = np.concatenate([[0], jumps(log), [len(log)]])
    longest = int(np.argmax(np.diff(edges)))
    return _part(log, int(edges[longest]), int(edges[longest + 1]))


def with_forces(log: RobotLog) -> RobotLog:
    """The longest stretch in which the force sensor has readings; without it, where that is short."""
    if log.force is None or np.isfinite(log.force).all():
        return log
    there = np.isfinite(log.force).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(np.int8)))
    runs = edges.reshape(-1, 2)
    if len(runs):
        first, end = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))]
        if end - first >= len(log) // 4:
            return _part(log, int(first), int(end))
    return replace(log, force=None)


def _part(log: RobotLog, first: int, end: int) -> RobotLog:
    part = slice(first, end)
    names = ("t", "theta", "tau", "force", "perturbation", "sync")
    columns = {name: own for name in names if (own := getattr(log, name)) is not None}
    return replace(log, **{name: own[part] for name, own in columns.items()})


def _onto(t: Floats, values: Floats, grid: Floats) -> Floats:
    """Means over 10 ms, then a cubic spline through them: (M, k) at t (M,) -> (len(grid), k)."""
    place = np.floor(t / _BIN_S).astype(np.int64)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(place)) + 1])
    count = np.diff(np.concatenate([starts, [len(t)]]))
    means = np.add.reduceat(values, starts, axis=0) / count[:, None]
    at = np.add.reduceat(t, starts) / count
    rising = np.concatenate([[True], np.diff(at) > 0])
    result: Floats = Spline(at[rising], means[rising])(np.clip(grid, at[0], at[-1]))
    return result
