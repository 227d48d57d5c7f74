"""From a study to views: every trial on one clock at a modest rate, raw signals filtered widely and alike."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impid_host.clock.robot import RobotClockFit, match_clocks
from impid_host.diagnosis.band import WIDEST_HZ, band_hz, quick_band_hz
from impid_host.diagnosis.base import Base
from impid_host.diagnosis.oddities import Oddity, odd_rows
from impid_host.effects.effect import Setting
from impid_host.effects.view import View, rate_of, rotated
from impid_host.errors import UndeterminedError
from impid_host.impedance.loads import ROTARY_AXES
from impid_host.robot.model import RobotModel
from impid_host.samples import rows_of
from impid_host.signals.align import base_frame_force, device_angles, robot_rows, sensor_angle
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.chain import PUBLISHED_CUTOFF_HZ
from impid_host.signals.counts import has_angles, longest_run, specific_force, usable_samples
from impid_host.signals.filters import ZeroPhaseLowPass
from impid_host.signals.resample import Grid, bridged, common_grid, nominal_rate, onto_grid
from impid_host.study.model import RobotLog, Setup, Study, Trial

VIEW_RATE_HZ = 250.0
_OPEN_S = 0.1
_WIDE = ZeroPhaseLowPass(order=4, cutoff_hz=60.0)

Signals = dict[str, Floats | None]


def views(study: Study, model: RobotModel) -> tuple[list[View], list[Oddity]]:
    """The study's free and loaded trials as views, the present model not yet in them; and what was left out.

    Raises:
        UndeterminedError: no such trial, or clocks that cannot be matched.
    """
    trials = study.of_kind("free", "mass-spring", "arm")
    if not trials:
        raise UndeterminedError(
            f"study {study.name}: no free, mass-spring or arm trial, so there is nothing to diagnose"
        )
    result, oddities = [], []
    for trial in trials:
        bad, found = odd_rows(trial.name, robot_rows(trial.robot))
        result.append(view_of(trial, study.setup, model, bad))
        oddities += found
    cutoff = band_hz(result)
    if tuple(model.task_axes) == ROTARY_AXES:
        cutoff = quick_band_hz(result)
        report = max(PUBLISHED_CUTOFF_HZ, cutoff if cutoff > WIDEST_HZ else 0.0)
        return [replace(view, cutoff_hz=cutoff, report_hz=report) for view in result], oddities
    return [replace(view, cutoff_hz=cutoff) for view in result], oddities


def view_of(trial: Trial, setup: Setup, model: RobotModel, bad: Mask) -> View:
    """One trial, without the `bad` rows of the robot's log.

    Raises:
        UndeterminedError: its clocks cannot be matched, or less than 2 s are left.
    """
    signals, valid, rate = _on_grid(trial, setup, ~bad)
    force, angles = signals["force"], signals["theta"]
    if force is not None and angles is not None:
        signals["force"] = base_frame_force(force, angles, setup.force_sensor, model)
    step = max(1, round(rate / VIEW_RATE_HZ))
    wide = {name: _widely(values, rate) for name, values in signals.items() if values is not None}
    theta = wide["theta"]
    omega, acc = rate_of(theta, 1 / rate), rate_of(rate_of(theta, 1 / rate), 1 / rate)
    some = slice(None, None, step)
    theta, omega, acc = theta[some], omega[some], acc[some]
    J = model.jacobian(theta)
    v = np.einsum("kij,kj->ki", J, omega)
    a = np.einsum("kij,kj->ki", J, acc) + np.einsum("kij,kj->ki", model.jacobian_rate(theta, omega), omega)
    count = len(theta)
    measured, angle = None, None
    turn = np.zeros(count)
    turn_rate = np.zeros(count)
    if "measured" in wide and setup.accelerometer is not None and len(model.task_axes) == 2:
        measured = wide["measured"][some]
        angle = sensor_angle(theta, setup.accelerometer, model)
        if setup.accelerometer.mount == "link2":
            turn, turn_rate = model.tip_turn(omega), model.tip_turn(acc)
    robot = wide["theta_robot"][some] if "theta_robot" in wide else None
    axes = len(model.task_axes)
    return View(
        name=trial.name,
        kind=trial.kind,
        load=None if trial.kind == "free" else trial.load,
        t=np.arange(count, dtype=np.float64) * (step / rate),
        dt=step / rate,
        theta=theta,
        omega=omega,
        acc=acc,
        tau=wide["tau"][some],
        x=model.position(theta),
        v=v,
        a=a,
        J=J,
        sensor_angle=angle,
        measured=measured,
        predicted=None if angle is None else rotated(a - np.array(model.plane_gravity_m_s2), -angle),
        turn=turn,
        turn_rate=turn_rate,
        theta_robot=robot,
        # fx and fy are forces in the plane; another robot has no axes for them.
        force=wide["force"][some] if "force" in wide and axes == 2 else None,
        torque_model=np.zeros_like(theta),
        x0=np.zeros(axes),
        K=np.zeros((axes, axes)),
        valid=valid[some],
        model=model,
    )


def setting_of(parts: Sequence[View], base: Base) -> Setting:
    """What of the apparatus and the motion decides which candidates make sense."""
    model = base.model
    theta = np.concatenate([view.theta[view.valid] for view in parts])
    omega = np.concatenate([np.abs(view.omega[view.valid]) for view in parts])
    reach = max((float(np.ptp(view.x[view.valid], axis=0).max()) for view in parts if view.load), default=0.0)
    planar = len(model.task_axes) == 2
    return Setting(
        joints=model.joints,
        slides=model.prismatic,
        planar=planar,
        axes=len(model.task_axes),
        rotary_load=tuple(model.task_axes) == ROTARY_AXES,
        bare=base.bare,
        span=np.maximum(np.ptp(theta, axis=0), 1e-6),
        speed=np.maximum(np.percentile(omega, 95, axis=0), 1e-6),
        reach=reach,
        springs=tuple(sorted({view.load for view in parts if view.load and view.kind == "mass-spring"})),
        arms=tuple(sorted({view.load for view in parts if view.load and view.kind == "arm"})),
        accelerometer=any(view.measured is not None for view in parts),
        second_clock=any(view.theta_robot is not None for view in parts),
        force_sensor=any(view.force is not None and view.load for view in parts),
        duration_s=max(float(view.t[-1]) for view in parts),
    )


def _widely(values: Floats, rate_hz: float) -> Floats:
    return values if rate_hz < 4 * _WIDE.cutoff_hz else _WIDE.apply(values, rate_hz)


def _matched(trial: Trial, t_device: Floats, theta_device: Floats, log: RobotLog) -> RobotClockFit:
    """Clocks that wander are to be found, not refused: the match may leave more open than elsewhere."""
    joints = theta_device.shape[1]
    try:
        return match_clocks(t_device, theta_device, log.t, log.theta[:, :joints], widest_s=_OPEN_S)
    except UndeterminedError as error:
        raise UndeterminedError(f"trial {trial.name}: {error}") from error


def _on_grid(trial: Trial, setup: Setup, good: Mask) -> tuple[Signals, Mask, float]:
    log = robot_rows(trial.robot)
    if trial.device is None or not has_angles(trial.device):
        rate = nominal_rate(log.t)
        grid = common_grid(log.t[0], log.t[-1], rate)
        signals, valid = _robot_signals(log, log.t, good, grid)
        signals["theta"] = signals.pop("theta_robot")
    else:
        t_device, theta_device = device_angles(trial.device, setup)
        t_robot = _matched(trial, t_device, theta_device, log).to_device(log.t)
        rate = nominal_rate(t_device)
        grid = common_grid(max(t_device[0], t_robot[0]), min(t_device[-1], t_robot[-1]), rate)
        joints = theta_device.shape[1]
        log = replace(log, theta=log.theta[:, :joints])
        signals, valid = _robot_signals(log, t_robot, good, grid)
        every = np.ones(len(t_device), dtype=bool)
        signals["theta"] = onto_grid(t_device, theta_device, every, grid)
        valid &= bridged(t_device, every, grid)
    if trial.device is not None and setup.accelerometer is not None:
        run = rows_of(trial.device, longest_run(trial.device))
        usable, t_felt = usable_samples(run), run.t_us.astype(np.float64) * 1e-6
        felt = specific_force(run, setup.accelerometer)
        signals["measured"] = onto_grid(t_felt - setup.accelerometer.delay_s, felt, usable, grid)
        valid &= bridged(t_felt, usable, grid)
    return signals, valid, rate


def _robot_signals(log: RobotLog, t: Floats, good: Mask, grid: Grid) -> tuple[Signals, Mask]:
    """The robot's columns on the grid; instants beside a missing force are not valid."""
    every, valid, force = np.ones(len(log), dtype=bool), bridged(t, good, grid), None
    if log.force is not None:
        known = np.asarray(np.isfinite(log.force).all(axis=1))
        if known.any():
            force = onto_grid(t, log.force, known, grid)
            valid = valid & bridged(t, known, grid)
    signals: Signals = {
        "theta_robot": onto_grid(t, log.theta, every, grid),
        "tau": onto_grid(t, log.tau, good, grid),
        "force": force,
        "measured": None,
    }
    return signals, valid
