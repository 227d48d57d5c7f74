"""From a motion and the effects to what reaches the instruments."""

from __future__ import annotations

import numpy as np

from .effects import Effect
from .instruments import Signals
from .mechanics import Array
from .motion import Motion


def delivered(m: Motion, effects: tuple[Effect, ...]) -> tuple[Array, Array]:
    """Torque of the motors and force of the load on the robot, with what the effects add to both."""
    force = np.zeros_like(m.theta)
    if m.load is not None:
        force = m.load.force(m.x, m.v, m.a)
        for effect in effects:
            if effect.acts(m):
                force = force + effect.load_force(m, force)
    tau = m.robot.inverse(m.theta, m.omega, m.accel) - m.robot.to_joints(m.theta, force)
    for effect in effects:
        if effect.acts(m):
            tau = tau + effect.reaction(m, tau)
    return tau, force


def signals(m: Motion, effects: tuple[Effect, ...]) -> Signals:
    """What reaches the instruments."""
    ins = m.laboratory.instruments
    tau, force = delivered(m, effects)
    theta, logged, clock = m.theta, tau, np.zeros_like(m.t)
    felt = m.turned(ins.mount, ins.mount_angle, m.a)
    sensed = m.turned(ins.force_frame, ins.force_angle, force)
    for effect in effects:
        if effect.acts(m):
            theta = effect.angle(m, theta, tau)
            logged = effect.drive(m, logged)
            felt = effect.felt(m, felt, tau)
            sensed = effect.sensed(m, sensed)
            clock = clock + effect.clock(m, m.t)
    return Signals(theta, logged, felt, sensed, clock)
