"""One trial's two logs on one uniform clock, with its motion in joints and in space.

Both logs go onto a grid at the module's rate; the chain's filters and derivatives run there. Where the
robot's log is slower, all signals are then thinned alike to its rate, which is as much as it tells.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from impid_host.clock.robot import RobotClockFit, match_clocks
from impid_host.errors import UndeterminedError
from impid_host.robot.model import RobotModel
from impid_host.samples import ModuleSamples, rows_of
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.chain import Chain, erode
from impid_host.signals.counts import has_angles, joint_angles, longest_run, specific_force, usable_samples
from impid_host.signals.force_timing import as_means
from impid_host.signals.resample import (
    SHORTEST_S,
    Grid,
    bridged,
    common_grid,
    meeting_rate,
    nominal_rate,
    onto_grid,
    oversampling,
    thinned,
)
from impid_host.signals.systems import solved
from impid_host.study.model import AccelerometerSetup, ForceSensor, RobotLog, Setup, Trial, TrialKind

AccelerationSource = Literal["accelerometer", "angles"]


@dataclass(frozen=True, slots=True)
class AlignedTrial:
    """A trial on one uniform grid of N instants; n joints, d task axes; before the chain's `finish`.

    Attributes:
        t: the module's clock (the robot's, without a module), s, shape (N,), from the trial's first common
            instant.
        rate_hz: of the grid: that of the slower log.
        theta, omega, theta_dd: joint angle, velocity, acceleration, rad and s (m for a prismatic joint),
            shape (N, n).
        tau: joint torque, N m (N), shape (N, n).
        force: physical sensor, force of the load on the robot, base frame, N, shape (N, 2), or None.
        perturbation: commanded perturbation force, N, shape (N, 2), or None.
        reference: what the controller was told to follow, rad (m), shape (N, n), or None.
        x, v, a: end-effector position, velocity, acceleration in the base frame, shape (N, d).
        valid: instants that neither a gap nor a filter's edge touches, shape (N,).
        source: where theta_dd and a come from.
        clock: the match of the two clocks; None without a module.
    """

    name: str
    kind: TrialKind
    load: str
    t: Floats
    rate_hz: float
    theta: Floats
    omega: Floats
    theta_dd: Floats
    tau: Floats
    force: Floats | None
    perturbation: Floats | None
    x: Floats
    v: Floats
    a: Floats
    valid: Mask
    source: AccelerationSource
    clock: RobotClockFit | None
    reference: Floats | None = None

    @property
    def elapsed(self) -> Floats:
        """Seconds since the first instant, shape (N,)."""
        result: Floats = self.t - self.t[0]
        return result


@dataclass(frozen=True, slots=True)
class RawSignals:
    """What was measured, on one grid, before any filter; the trial keeps every `thin`-th instant.

    Attributes:
        theta: joint angles by the module where it has them, (N, n); theta_robot: by the controller, None
            where there is no second clock.
        specific_force: along the sensor's axes, m/s^2, (N, 2); force: along the force sensor's, N, (N, 2).
    """

    grid: Grid
    thin: int
    theta: Floats
    theta_robot: Floats | None
    specific_force: Floats | None
    tau: Floats
    force: Floats | None
    perturbation: Floats | None
    valid: Mask
    clock: RobotClockFit | None
    reference: Floats | None = None


def device_angles(device: ModuleSamples, setup: Setup) -> tuple[Floats, Floats]:
    """Times (N,), s, and angles (N, n) of the module's longest run without a reset or encoder fault.

    Raises:
        UndeterminedError: the module has no angles, or the setup does not describe its encoders.
    """
    run = _run(device)
    keep = usable_samples(run)
    theta = joint_angles(run, setup.encoder)
    return run.t_us.astype(np.float64)[keep] * 1e-6, theta[keep]


def robot_rows(log: RobotLog) -> RobotLog:
    """The log's rows whose stamps increase and whose numbers are finite."""
    good = np.isfinite(log.t) & np.isfinite(log.theta).all(axis=1) & np.isfinite(log.tau).all(axis=1)
    latest = np.maximum.accumulate(np.where(np.isfinite(log.t), log.t, -np.inf))
    good[1:] &= log.t[1:] > latest[:-1]
    if good.all():
        return log
    return RobotLog(
        t=log.t[good],
        theta=log.theta[good],
        tau=log.tau[good],
        force=None if log.force is None else log.force[good],
        perturbation=None if log.perturbation is None else log.perturbation[good],
        sync=None if log.sync is None else log.sync[good],
        stamps=log.stamps,
        reference=None if log.reference is None else log.reference[good],
    )


def match_trial(trial: Trial, setup: Setup, widest_s: float | None = None) -> RobotClockFit:
    """The clock match of one trial.

    Args:
        widest_s: how much the match may leave open; the clock's own limit where it is None.

    Raises:
        UndeterminedError: no module in this trial, or the angles do not determine the clocks; names the
            trial.
    """
    if trial.device is None:
        raise UndeterminedError(f"trial {trial.name}: no device.csv, so there is no second clock to match")
    t_device, theta_device = device_angles(trial.device, setup)
    rows = robot_rows(trial.robot)
    joints = theta_device.shape[1]
    try:
        limit = {} if widest_s is None else {"widest_s": widest_s}
        return match_clocks(t_device, theta_device, rows.t, rows.theta[:, :joints], **limit)
    except UndeterminedError as error:
        raise UndeterminedError(f"trial {trial.name}: {error}") from error


def align(
    trial: Trial, setup: Setup, model: RobotModel, chain: Chain, source: AccelerationSource | None = None
) -> AlignedTrial:
    """Put one trial on one clock and form its motion by the given chain.

    Args:
        source: where accelerations come from; by default the accelerometer where there is one ([D] footnote
            2 warns of the angles).

    Raises:
        UndeterminedError: the clocks cannot be matched, there is no accelerometer though it was asked for,
            or less than 2 s remain.
    """
    # Two axes of acceleration give as many joints' accelerations as move the end-effector in their plane.
    planar = model.joints == len(model.task_axes) == 2
    measured = trial.device is not None and setup.accelerometer is not None and planar
    if source == "accelerometer" and not measured:
        raise UndeterminedError(
            f"trial {trial.name}: no accelerometer beside this robot model; use --acceleration angles"
        )
    source = source or ("accelerometer" if measured else "angles")
    raw = raw_signals(trial, setup)
    rate = raw.grid.rate_hz
    theta, omega = chain.value(raw.theta, rate), chain.derivative(raw.theta, rate)
    x = model.position(theta)
    J, J_rate = model.jacobian(theta), model.jacobian_rate(theta, omega)
    v = np.einsum("kij,kj->ki", J, omega)
    if source == "accelerometer" and raw.specific_force is not None and setup.accelerometer is not None:
        along_axes = chain.value(raw.specific_force, rate)
        angle = sensor_angle(theta, setup.accelerometer, model)
        a = base_frame_acceleration(along_axes, angle, model.plane_gravity_m_s2)
        theta_dd = joint_acceleration(a, J, J_rate, omega)
    else:
        theta_dd = chain.second_derivative(raw.theta, rate)
        a = np.einsum("kij,kj->ki", J, theta_dd) + np.einsum("kij,kj->ki", J_rate, omega)
    force = None if raw.force is None else base_frame_force(raw.force, raw.theta, setup.force_sensor, model)
    fine = AlignedTrial(
        name=trial.name,
        kind=trial.kind,
        load=trial.load,
        t=raw.grid.t,
        rate_hz=rate,
        theta=theta,
        omega=omega,
        theta_dd=theta_dd,
        tau=chain.torque(raw.tau, rate),
        force=None if force is None else chain.torque(force, rate),
        perturbation=None if raw.perturbation is None else chain.torque(raw.perturbation, rate),
        x=x,
        v=v,
        a=a,
        valid=erode(raw.valid, int(chain.edge_s * rate)),
        source=source,
        clock=raw.clock,
        reference=raw.reference,
    )
    return _at_meeting_rate(fine, raw.thin)


def raw_signals(trial: Trial, setup: Setup, widest_s: float | None = None) -> RawSignals:
    """Everything that a trial measured on one uniform clock.

    Args:
        widest_s: how much the match of the clocks may leave open, s.

    Raises:
        UndeterminedError: the clocks cannot be matched, or less than 2 s remain; names the trial.
    """
    try:
        if trial.device is None:
            return _on_robot_clock(trial, setup)
        return _on_device_clock(trial, trial.device, setup, widest_s)
    except UndeterminedError as error:
        text = str(error)
        raise UndeterminedError(text if trial.name in text else f"trial {trial.name}: {text}") from error


_SIGNALS = ("theta", "omega", "theta_dd", "tau", "force", "perturbation", "reference", "x", "v", "a")


def _at_meeting_rate(trial: AlignedTrial, thin: int) -> AlignedTrial:
    if thin == 1:
        return trial
    present = {name: values for name in _SIGNALS if (values := getattr(trial, name)) is not None}
    kept: dict[str, Any] = {name: thinned(values, thin) for name, values in present.items()}
    return replace(trial, **kept, t=trial.t[::thin], rate_hz=trial.rate_hz / thin, valid=trial.valid[::thin])


def sensor_angle(theta: Floats, accelerometer: AccelerometerSetup, model: RobotModel) -> Floats:
    """Angle from x to the sensor's first axis: (N, n) -> (N,), rad."""
    angle = np.full(len(theta), accelerometer.mount_angle_rad)
    return angle + model.tip_angle(theta) if accelerometer.mount == "link2" else angle


def base_frame_force(force: Floats, theta: Floats, sensor: ForceSensor, model: RobotModel) -> Floats:
    """Force along the sensor's axes in the base frame: (N, 2), (N, n) -> (N, 2), N."""
    angle = np.full(len(force), sensor.mount_angle_rad)
    if sensor.frame == "link2":
        angle = angle + model.tip_angle(theta)
    elif sensor.mount_angle_rad == 0.0:
        return force
    return base_frame_acceleration(force, angle)


def base_frame_acceleration(
    along_axes: Floats, angle: Floats, gravity_m_s2: tuple[float, float] = (0.0, 0.0)
) -> Floats:
    """Specific force along the sensor's axes (N, 2) as acceleration in the base frame (N, 2), m/s^2.

    Args:
        angle: from x to the sensor's first axis, (N,).
        gravity_m_s2: in the plane; a sensor at rest feels the opposite.
    """
    c, s = np.cos(angle), np.sin(angle)
    first, second = along_axes.T
    felt = np.stack([c * first - s * second, s * first + c * second], axis=1)
    return np.asarray(felt + np.array(gravity_m_s2))


def joint_acceleration(a: Floats, J: Floats, J_rate: Floats, omega: Floats) -> Floats:
    """[D] eq. 7, theta'' = J^-1 (x'' - J' theta'): (N, 2), (N, 2, 2) twice, (N, 2) -> (N, 2), rad/s^2."""
    remainder = a - np.einsum("kij,kj->ki", J_rate, omega)
    result: Floats = solved(J, remainder[:, :, None])[:, :, 0]
    return result


def _run(device: ModuleSamples) -> ModuleSamples:
    if len(device) == 0:
        raise UndeterminedError("device.csv has no samples")
    return rows_of(device, longest_run(device))


def _on_device_clock(trial: Trial, device: ModuleSamples, setup: Setup, widest_s: float | None) -> RawSignals:
    run, log = _run(device), as_means(robot_rows(trial.robot), setup.force_sensor)
    clock = match_trial(trial, setup, widest_s) if has_angles(run) else None
    t_device = run.t_us.astype(np.float64) * 1e-6
    t_robot = log.t if clock is None else clock.to_device(log.t)
    rate_device, usable = nominal_rate(t_device), usable_samples(run)
    meeting = meeting_rate(rate_device, nominal_rate(t_robot))
    thin = oversampling(rate_device, meeting)
    start, end = max(t_device[0], t_robot[0]), min(t_device[-1], t_robot[-1])
    if clock is None and end - start < SHORTEST_S:
        raise UndeterminedError(
            f"the module has no angles and its stamps (from {t_device[0]:.3f} s) do not overlap with the "
            f"robot's (from {t_robot[0]:.3f} s); it must share the robot's clock, or log the angles"
        )
    grid = common_grid(start, end, meeting * thin)
    on_robot = _RobotOnGrid(log, t_robot, grid)
    theta, felt = _module_on_grid(run, setup, t_device, usable, grid)
    return RawSignals(
        grid=grid,
        thin=thin,
        theta=on_robot.theta if theta is None else theta,
        theta_robot=None if theta is None else on_robot.theta[:, : theta.shape[1]],
        specific_force=felt,
        tau=on_robot.tau,
        force=on_robot.force,
        perturbation=on_robot.perturbation,
        valid=bridged(t_device, usable, grid) & on_robot.valid,
        clock=clock,
        reference=on_robot.reference,
    )


def _module_on_grid(
    run: ModuleSamples, setup: Setup, t: Floats, usable: Mask, grid: Grid
) -> tuple[Floats | None, Floats | None]:
    """Angles (N, n) and specific force (N, 2) on the grid, None for what the module does not measure."""
    theta = joint_angles(run, setup.encoder) if has_angles(run) else None
    if setup.accelerometer is None:
        return None if theta is None else onto_grid(t, theta, usable, grid), None
    felt, delay_s = specific_force(run, setup.accelerometer), setup.accelerometer.delay_s
    if theta is None or delay_s != 0.0:
        # What the sensor felt at t comes out delay_s later.
        later = onto_grid(t - delay_s, felt, usable, grid)
        return None if theta is None else onto_grid(t, theta, usable, grid), later
    together = onto_grid(t, np.concatenate([theta, felt], axis=1), usable, grid)
    return together[:, :-2], together[:, -2:]


def _on_robot_clock(trial: Trial, setup: Setup) -> RawSignals:
    log = as_means(robot_rows(trial.robot), setup.force_sensor)
    grid = common_grid(log.t[0], log.t[-1], nominal_rate(log.t))
    on_robot = _RobotOnGrid(log, log.t, grid)
    return RawSignals(
        grid=grid,
        thin=1,
        theta=on_robot.theta,
        theta_robot=None,
        specific_force=None,
        tau=on_robot.tau,
        force=on_robot.force,
        perturbation=on_robot.perturbation,
        valid=on_robot.valid,
        clock=None,
        reference=on_robot.reference,
    )


class _RobotOnGrid:
    """The robot's columns on a grid, by one spline; instants beside a missing force are not valid."""

    def __init__(self, log: RobotLog, t: Floats, grid: Grid) -> None:
        columns = {"theta": log.theta, "tau": log.tau, "force": log.force, "perturbation": log.perturbation}
        columns["reference"] = log.reference
        present = {name: values for name, values in columns.items() if values is not None}
        known = {name: np.isfinite(values).all(axis=1) for name, values in present.items()}
        present = {name: values for name, values in present.items() if known[name].any()}
        every = np.logical_and.reduce([known[name] for name in present])
        together = onto_grid(t, np.concatenate(list(present.values()), axis=1), every, grid)
        edges = np.cumsum([values.shape[1] for values in present.values()])[:-1]
        parts = dict(zip(present, np.split(together, edges, axis=1), strict=True))
        self.theta, self.tau = parts["theta"], parts["tau"]
        self.force, self.perturbation = parts.get("force"), parts.get("perturbation")
        self.reference = parts.get("reference")
        self.valid = bridged(t, every, grid)
