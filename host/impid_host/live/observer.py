"""The force of the load while it is recorded: two streams in, a force at each row of the robot out.

Speeds come from the robot's angles and the module's accelerometer together (`motion`), the load's torque
from them and the drives' (`momentum`). Which sample belongs to which row is known once the clocks have been
matched on some seconds of both streams (`window`); until then, and while no samples come, the angles must
do, and a slower observer keeps their noise down.

Torques do not wait for samples that are still on their way: those rows are worked out at once, with the
acceleration carried on straight; what is carried over to the next rows is worked out again with the samples.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from impid_host.clock.robot import RobotClockFit
from impid_host.impedance.identify import RobotParameters
from impid_host.impedance.virtual_sensor import through_jacobian
from impid_host.live.module import Module
from impid_host.live.momentum import Momentum, observe
from impid_host.live.motion import Motion, follow
from impid_host.live.torques import Rows
from impid_host.samples import DeviceSamples
from impid_host.signals.align import base_frame_acceleration, joint_acceleration, sensor_angle
from impid_host.signals.arrays import Floats
from impid_host.study.model import Setup

_GAP_S = 0.1  # across which nothing is carried on


@dataclass(frozen=True, slots=True)
class Tuning:
    """How quick the observer is: its gain, 1/s, and how long the angles count for the speeds, s."""

    gain: float
    memory_s: float


WITH_MODULE = Tuning(gain=200.0, memory_s=0.05)
BY_ANGLES = Tuning(gain=80.0, memory_s=0.01)


@dataclass(frozen=True, slots=True)
class State:
    """What the next row needs of those before."""

    motion: Motion
    momentum: Momentum
    with_module: bool


@dataclass(frozen=True, slots=True)
class Force:
    """Force of the load on the robot, base frame.

    Attributes:
        t: instants that it belongs to, s on the robot's clock, the observer's own lag taken off, (N,).
        force: N (N m where the load is rotary), (N, d).
        with_module: whether the accelerometer took part.
    """

    t: Floats
    force: Floats
    with_module: bool


class LiveForce:
    """One recording's observer.

    Args:
        setup, robot: the apparatus, and its parameters by a saved model.
        window_s: of both streams, kept for `window.look`.
    """

    def __init__(self, setup: Setup, robot: RobotParameters, window_s: float) -> None:
        model = robot.structure.model
        planar = model.joints == len(model.task_axes) == 2
        self._accelerometer = setup.accelerometer if planar else None
        self._robot = robot
        self._window_s = window_s
        self.module = Module(self._accelerometer, window_s)
        self.clock: RobotClockFit | None = None
        self._clock_of: tuple[int, int] | None = None
        self._state: State | None = None
        self._waiting: Rows | None = None  # rows that have been shown, and wait for their samples
        self._last: deque[Rows] = deque()

    def matched(self, clock: RobotClockFit, run: tuple[int, int] | None) -> None:
        """The clocks' match, found on samples of that run."""
        self.clock, self._clock_of = clock, run

    def restart(self) -> None:
        """The robot's clock has begun anew."""
        self.clock, self._state, self._waiting = None, None, None
        self._last.clear()

    def take(self, rows: Rows) -> Force:
        """The force at each of these rows, which follow those before; at least one."""
        self._last.append(rows)
        while rows.t[-1] - self._last[0].t[-1] > self._window_s:
            self._last.popleft()
        reached = self._state.momentum.t if self._state is not None else rows.t[0]
        if rows.t[0] - max(reached, self._waiting.t[-1] if self._waiting else reached) > _GAP_S:
            self._state, self._waiting = None, None
        pending = rows if self._waiting is None else Rows.joined([self._waiting, rows])
        felt = self._known(pending)
        if felt is None:
            self._waiting = None
            force, self._state = self._work_out(pending, np.zeros_like(pending.theta), with_module=False)
        else:
            force = self._with_samples(pending, felt)
        tuning = WITH_MODULE if felt is not None else BY_ANGLES
        return Force(rows.t - 1.0 / tuning.gain, force[-len(rows) :], felt is not None)

    def last(self) -> tuple[DeviceSamples, Rows] | None:
        """The last seconds of both streams; None where one of them is missing."""
        device = self.module.last()
        if device is None or not self._last:
            return None
        return device, Rows.joined(list(self._last))

    def _known(self, rows: Rows) -> Floats | None:
        """Instants of the rows on the module's clock, where its samples can serve them."""
        if self._accelerometer is None or self.clock is None or self._clock_of != self.module.run:
            return None
        t = self.clock.to_device(rows.t)
        return t if self.module.knows(t) else None

    def _with_samples(self, rows: Rows, at: Floats) -> Floats:
        """Forces at these rows; those whose samples have come are done with, the others wait."""
        acceleration = self._acceleration(rows, at)
        done = int(np.searchsorted(at, self.module.newest_s, side="right"))
        forces = []
        if done:
            part = slice(0, done)
            force, self._state = self._work_out(rows.part(part), acceleration[part], with_module=True)
            forces.append(force)
        rest = slice(done, None)
        self._waiting = rows.part(rest) if done < len(rows) else None
        if self._waiting is not None:
            forces.append(self._work_out(self._waiting, acceleration[rest], with_module=True)[0])
        return np.concatenate(forces)

    def _acceleration(self, rows: Rows, at: Floats) -> Floats:
        """Of the joints, by the accelerometer, (N, n); [D] eq. 7."""
        assert self._accelerometer is not None
        model = self._robot.structure.model
        angle = sensor_angle(rows.theta, self._accelerometer, model)
        a = base_frame_acceleration(self.module.felt_at(at), angle, model.plane_gravity_m_s2)
        J = model.jacobian(rows.theta)
        before = self._state
        if before is None:
            return joint_acceleration(a, J, np.zeros_like(J), np.zeros_like(rows.theta))
        # The turning of the Jacobian needs the speeds: the last one, carried on by what the sensor feels.
        speed = np.tile(before.motion.speed, (len(a), 1))
        start = joint_acceleration(a, J, model.jacobian_rate(rows.theta, speed), speed)
        speed = speed + (rows.t - before.motion.t)[:, None] * start
        return joint_acceleration(a, J, model.jacobian_rate(rows.theta, speed), speed)

    def _motion(self, acceleration: Floats, *, with_module: bool) -> Motion | None:
        if self._state is None:
            return None
        if self._state.with_module == with_module:
            return self._state.motion
        motion = self._state.motion
        return motion.by_accelerometer(acceleration[0]) if with_module else motion.by_angles()

    def _work_out(self, rows: Rows, acceleration: Floats, *, with_module: bool) -> tuple[Floats, State]:
        tuning = WITH_MODULE if with_module else BY_ANGLES
        motion = self._motion(acceleration, with_module=with_module)
        omega, motion = follow(motion, rows.t, rows.theta, acceleration, tuning.memory_s)
        structure = self._robot.structure
        torque, momentum = observe(
            structure,
            self._robot.value,
            tuning.gain,
            None if self._state is None else self._state.momentum,
            rows.t,
            rows.theta,
            omega,
            rows.tau,
        )
        force = through_jacobian(structure.model, rows.theta, torque)
        return force, State(motion, momentum, with_module)
