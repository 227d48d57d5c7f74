"""What the papers' model leaves of signals, with the true parameters: the scale on which footprints are measured.

Everything is taken on 100 Hz after a zero-phase low-pass at 10 Hz, in four channels: tau1, tau2 (N m, torque
less robot less load) and fsx, fsy (N, force sensor less load).
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from .instruments import BAND, Record, Signals
from .mechanics import Array, Load, Robot
from .motion import RATE, Motion, derivative, low_pass, moving

STEP = 10  # of the fine grid, for 100 Hz
COARSE = RATE / STEP
CHANNELS = ("tau1", "tau2", "fsx", "fsy")


@dataclass(frozen=True)
class Seen:
    """One trial's signals as an analyst would use them; rows at 100 Hz within the record."""

    theta: Array
    omega: Array
    x: Array
    v: Array
    a: Array
    tau: Array
    force: Array
    robot: Robot


def inside(m: Motion) -> NDArray[np.bool_]:
    t = m.t[::STEP]
    return (t >= 0) & (t <= m.plan.duration)


def analyst(m: Motion, s: Signals, lengths: tuple[float, float]) -> Seen:
    """Signals in the declared frames, the clocks matched by a straight line."""
    ins = m.laboratory.instruments
    wander = s.clock - np.polyval(np.polyfit(m.t, s.clock, 1), m.t)
    late = [np.interp(m.t - wander, m.t, c) if wander.any() else c for c in (*s.tau.T, *s.force.T)]
    low = low_pass(np.column_stack([s.theta, s.felt, *late]), BAND)[::STEP]
    theta = low[:, :2]
    robot = replace(m.robot, lengths=lengths)
    omega = derivative(theta, COARSE)
    shell = moving(m.laboratory, m.plan, m.index, m.since, m.t[::STEP], theta)
    a = shell.turned(ins.mount, ins.mount_angle, low[:, 2:4], back=True)
    force = shell.turned(ins.force_frame, ins.force_angle, low[:, 6:8], back=True)
    v, _ = robot.tip_rates(theta, omega, np.zeros_like(omega))
    rows = inside(m)
    parts = (theta, omega, robot.tip(theta), v, a, low[:, 4:6], force)
    theta, omega, x, v, a, tau, force = (p[rows] for p in parts)
    return Seen(theta, omega, x, v, a, tau, force, robot)


def thinned(seen: Seen, every: int) -> Seen:
    """Every so many rows."""
    names = [f.name for f in fields(seen) if f.name != "robot"]
    return replace(seen, **{name: getattr(seen, name)[::every] for name in names})


def residual(m: Motion, seen: Seen) -> Array:
    """(n, 4), see CHANNELS."""
    accel = seen.robot.joint_accel(seen.theta, seen.omega, seen.a)
    force = np.zeros_like(seen.force) if m.load is None else m.load.force(seen.x, seen.v, seen.a)
    torque = (
        seen.tau - seen.robot.inverse(seen.theta, seen.omega, accel) + seen.robot.to_joints(seen.theta, force)
    )
    return np.column_stack([torque, seen.force - force])


def alpha_columns(seen: Seen) -> Array:
    """What each of the robot's five parameters does to the residual, (n, 4, 5)."""
    accel = seen.robot.joint_accel(seen.theta, seen.omega, seen.a)
    out = []
    for j in range(5):
        unit = replace(seen.robot, alpha=tuple(float(i == j) for i in range(5)))
        out.append(np.column_stack([unit.inverse(seen.theta, seen.omega, accel), np.zeros_like(accel)]))
    return np.stack(out, axis=2)


def load_columns(load: Load, seen: Seen) -> Array:
    """What each parameter of a load does to the residual, (n, 4, p)."""
    one = np.ones(seen.x.shape[0])
    if load.kind == "arm":
        terms = [(q, i, j) for q in (seen.a, seen.v, seen.x) for i in range(2) for j in range(2)]
        shapes = [_placed(q[:, j], i) for q, i, j in terms]
    else:
        shapes = [_placed(seen.x[:, 0], 0), _placed(seen.x[:, 1], 1), seen.x[:, ::-1]]
        shapes += [] if load.payload is not None else [seen.a]  # a weighed payload is no unknown
    shapes += [_placed(one, 0), _placed(one, 1)]
    return np.stack([np.column_stack([seen.robot.to_joints(seen.theta, f), -f]) for f in shapes], axis=2)


def _placed(values: Array, row: int) -> Array:
    out = np.zeros((values.size, 2))
    out[:, row] = values
    return out


@dataclass(frozen=True)
class NoiseSeen:
    """Noise of one trial at 100 Hz: torque (N m), base-frame acceleration (m/s²), base-frame force (N)."""

    tau: Array
    accel: Array
    force: Array


def noise_seen(m: Motion, r: Record, cutoff: float = BAND) -> NoiseSeen:
    """Noise interpolated over lost rows, low-passed like the signals."""
    ins = m.laboratory.instruments
    grid = m.t[inside_fine(m)]

    def even(t: Array, noise: Array) -> Array:
        if t.size > 2 * grid.size:  # a faster log would alias: average it down first
            noise = low_pass(noise, 0.2 * RATE, t.size / m.plan.duration)
        return np.column_stack([np.interp(grid, t, noise[:, j]) for j in range(2)])

    stacked = np.column_stack(
        [even(r.robot_t, r.torque_noise), even(r.module_t, r.accel_noise), even(r.robot_t, r.force_noise)]
    )
    low = low_pass(stacked, cutoff, order=5)[::STEP]
    shell = moving(m.laboratory, m.plan, m.index, m.since, grid[::STEP], m.theta[inside_fine(m)][::STEP])
    return NoiseSeen(
        low[:, :2],
        shell.turned(ins.mount, ins.mount_angle, low[:, 2:4], back=True),
        shell.turned(ins.force_frame, ins.force_angle, low[:, 4:6], back=True),
    )


def inside_fine(m: Motion) -> NDArray[np.bool_]:
    return (m.t >= 0) & (m.t <= m.plan.duration)


def channel_noise(m: Motion, n: NoiseSeen) -> dict[str, Array]:
    """Noise in the channels of a diagnosis, each (n, 2): tau, f (virtual force less load's), fs (virtual less sensed)."""
    theta = m.theta[inside_fine(m)][::STEP]
    torque = n.tau - m.robot.inertia_times(theta, m.robot.solve(theta, n.accel))
    virtual = -m.robot.to_tip(theta, torque)  # force of the load on the robot
    moved = np.zeros((2, 2)) if m.load is None else m.load.moved
    return {"tau": torque, "f": virtual + n.accel @ moved.T, "fs": virtual - n.force, "sensor": n.force}
