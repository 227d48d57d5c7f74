"""From a study to views: every trial on one clock at a modest rate, raw signals filtered widely and alike."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impid_host.diagnosis.band import band_hz, quick_band_hz
from impid_host.diagnosis.base import Base
from impid_host.diagnosis.holdout import hold_out
from impid_host.diagnosis.oddities import Oddity, odd_rows
from impid_host.effects.effect import Setting
from impid_host.effects.view import View, rate_of, rotated
from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import default_chain
from impid_host.robot.model import RobotModel
from impid_host.signals.align import base_frame_force, raw_signals, robot_rows, sensor_angle
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.band import HIGHEST_OF_RATE
from impid_host.signals.filters import ZeroPhaseLowPass
from impid_host.study.model import Setup, Study, Trial

VIEW_RATE_HZ = 250.0
_OPEN_S = 0.1
_WIDE = ZeroPhaseLowPass(order=4, cutoff_hz=60.0)


def views(study: Study, model: RobotModel, cutoff_hz: float | None = None) -> tuple[list[View], list[Oddity]]:
    """The study's free and loaded trials as views, the present model not yet in them; and what was left out.

    Args:
        cutoff_hz: of the band that is reported; None: as `fit` has it by default, by the motion.

    Raises:
        UndeterminedError: no such trial, clocks that cannot be matched, or a band beyond what the logs show.
    """
    trials = study.of_kind("free", "mass-spring", "arm")
    if not trials:
        raise UndeterminedError(
            f"study {study.name}: no free, mass-spring or arm trial, so there is nothing to diagnose"
        )
    report = default_chain(study).cutoff_hz if cutoff_hz is None else cutoff_hz
    result, oddities = [], []
    for trial in trials:
        bad, found = odd_rows(trial.name, robot_rows(trial.robot))
        result.append(replace(view_of(trial, study.setup, model, bad), report_hz=report))
        oddities += found
    shown = min(HIGHEST_OF_RATE * min(view.meeting_hz, view.rate_hz) for view in result)
    if cutoff_hz is not None and cutoff_hz > shown:
        raise UndeterminedError(f"the logs show nothing above {shown:.3g} Hz; give a lower --cutoff")
    holdout = hold_out(result)
    if model.task_is_rotary:
        cutoff = quick_band_hz(result, holdout)
    else:
        cutoff = min(band_hz(result, holdout), *(HIGHEST_OF_RATE * view.meeting_hz for view in result))
    # Names that are chosen in a narrower band than they are judged in would be judged on what they never saw.
    return [replace(view, cutoff_hz=max(cutoff, report)) for view in result], oddities


def view_of(trial: Trial, setup: Setup, model: RobotModel, bad: Mask) -> View:
    """One trial, without the `bad` rows of the robot's log.

    Raises:
        UndeterminedError: its clocks cannot be matched, or less than 2 s are left.
    """
    log = robot_rows(trial.robot)
    believed = replace(trial, robot=replace(log, tau=np.where(bad[:, None], np.nan, log.tau)))
    # Clocks that wander are to be found, not refused: the match may leave more open than elsewhere.
    raw = raw_signals(believed, setup, widest_s=_OPEN_S)
    rate = raw.grid.rate_hz
    step = max(1, round(rate / VIEW_RATE_HZ))
    theta = _widely(raw.theta, rate)
    omega, acc = rate_of(theta, 1 / rate), rate_of(rate_of(theta, 1 / rate), 1 / rate)
    some = slice(None, None, step)
    theta, omega, acc = theta[some], omega[some], acc[some]
    J = model.jacobian(theta)
    v = np.einsum("kij,kj->ki", J, omega)
    a = np.einsum("kij,kj->ki", J, acc) + np.einsum("kij,kj->ki", model.jacobian_rate(theta, omega), omega)
    count = len(theta)
    measured, angle, force = None, None, None
    turn = np.zeros(count)
    turn_rate = np.zeros(count)
    axes = len(model.task_axes)
    planar = axes == model.joints == 2
    if raw.specific_force is not None and setup.accelerometer is not None and planar:
        measured = _widely(raw.specific_force, rate)[some]
        angle = sensor_angle(theta, setup.accelerometer, model)
        if setup.accelerometer.mount == "link2":
            turn, turn_rate = model.tip_turn(omega), model.tip_turn(acc)
    if raw.force is not None and axes == 2:
        # fx and fy are forces in the plane; another robot has no axes for them.
        in_base = base_frame_force(raw.force, raw.theta, setup.force_sensor, model)
        force = _widely(in_base, rate)[some]
    return View(
        name=trial.name,
        kind=trial.kind,
        load=None if trial.kind == "free" else trial.load,
        t=np.arange(count, dtype=np.float64) * (step / rate),
        dt=step / rate,
        theta=theta,
        omega=omega,
        acc=acc,
        tau=_widely(raw.tau, rate)[some],
        x=model.position(theta),
        v=v,
        a=a,
        J=J,
        sensor_angle=angle,
        measured=measured,
        predicted=None if angle is None else rotated(a - np.array(model.plane_gravity_m_s2), -angle),
        turn=turn,
        turn_rate=turn_rate,
        theta_robot=None if raw.theta_robot is None else _widely(raw.theta_robot, rate)[some],
        force=force,
        torque_model=np.zeros_like(theta),
        x0=np.zeros(axes),
        K=np.zeros((axes, axes)),
        valid=raw.valid[some],
        meeting_hz=rate / raw.thin,
        model=model,
        zero_rad=np.zeros(model.joints) if setup.encoder is None else np.array(setup.encoder.zero_rad),
    )


def setting_of(parts: Sequence[View], base: Base, *, referenced: bool) -> Setting:
    """What of the apparatus and the motion decides which terms make sense.

    Args:
        referenced: a weighed payload or an earlier robot is known.
    """
    model = base.model
    theta = np.concatenate([view.theta[view.valid] for view in parts])
    omega = np.concatenate([np.abs(view.omega[view.valid]) for view in parts])
    loaded = [view for view in parts if view.load is not None]
    return Setting(
        joints=model.joints,
        slides=model.prismatic,
        planar=len(model.task_axes) == 2,
        axes=len(model.task_axes),
        rotary_load=model.task_is_rotary,
        bare=base.bare,
        gravity=model.has_gravity or base.structure.gravity,
        links_m=model.link_lengths_m,
        span=np.maximum(np.ptp(theta, axis=0), 1e-6),
        speed=np.maximum(np.percentile(omega, 95, axis=0), 1e-6),
        reach=max((float(np.ptp(view.x[view.valid], axis=0).max()) for view in loaded), default=0.0),
        springs=tuple(sorted({str(view.load) for view in loaded if view.kind == "mass-spring"})),
        arms=tuple(sorted({str(view.load) for view in loaded if view.kind == "arm"})),
        trials=tuple(view.name for view in parts),
        loaded=tuple(view.name for view in loaded),
        accelerometer=any(view.measured is not None for view in parts),
        second_clock=any(view.theta_robot is not None for view in parts),
        force_sensor=any(view.force is not None for view in loaded),
        referenced=referenced,
        duration_s=max(float(view.t[-1]) for view in parts),
        held=frozenset(term.name for term in base.structure.terms),
    )


def _widely(values: Floats, rate_hz: float) -> Floats:
    return values if rate_hz < 4 * _WIDE.cutoff_hz else _WIDE.apply(values, rate_hz)
