"""What an effect may look at: one trial's motion, torques and forces, and what the model predicts there."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from impid_host.robot.model import RobotModel
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.chain import PUBLISHED_CUTOFF_HZ
from impid_host.signals.spline import Spline

TORQUE, SPECIFIC_FORCE, ANGLE, FORCE = "torque", "specific_force", "angle", "force"
FAMILIES = (TORQUE, SPECIFIC_FORCE, ANGLE, FORCE)

Columns = dict[str, Floats]
"""Residual family -> what one unit of each parameter adds to the measurement, (N, channels, parameters)."""


@dataclass(frozen=True, slots=True)
class View:
    """One trial on a uniform grid of N instants; n joints, d task axes. SI units.

    Accelerations come from the encoders: in the estimation band they are quieter than the accelerometer, and
    with them a fault of the accelerometer shows in the specific force alone.

    Attributes:
        load: name of the load on the end-effector; None in free motion.
        kind: of the trial.
        t: s since the trial's first instant, (N,); dt: its step.
        theta, omega, acc: joint angle and its derivatives, (N, n).
        tau: logged joint torque, (N, n).
        x, v, a: end-effector position, velocity, acceleration in the base frame, (N, d).
        J: (N, d, n).
        sensor_angle: of the accelerometer's first axis against x, rad, (N,); None without one.
        measured: specific force along the sensor's axes, (N, 2); predicted: what the encoders say; or None.
        turn, turn_rate: speed and acceleration of the sensor's rotation, (N,).
        theta_robot: the controller's reading, (N, n); None without a second clock.
        force: physical sensor, load on the robot, N, (N, 2); None without one.
        torque_model: the present model's torque, (N, n); x0: the load's equilibrium by it, (d,);
            K: its stiffness, (d, d); alpha: the robot's parameters by it, (p,).
        valid: instants that may be used, (N,).
        cutoff_hz: of the band in which the choice looks at this study; report_hz: of the reported one;
            meeting_hz: rate of the slower log.
        memo: what was worked out of this motion before, by name, joint and shape.
        zero_rad: declared angle at count 0, (n,), of the module's encoders.
        model: the robot's kinematics; respond: what the present model predicts of every family,
            (N, channels), were the motion that of the given view; response: of this one.
    """

    name: str
    kind: str
    load: str | None
    t: Floats
    dt: float
    theta: Floats
    omega: Floats
    acc: Floats
    tau: Floats
    x: Floats
    v: Floats
    a: Floats
    J: Floats
    sensor_angle: Floats | None
    measured: Floats | None
    predicted: Floats | None
    turn: Floats
    turn_rate: Floats
    theta_robot: Floats | None
    force: Floats | None
    torque_model: Floats
    x0: Floats
    K: Floats
    valid: Mask
    model: RobotModel
    zero_rad: Floats
    respond: "Callable[[View], Columns] | None" = None
    response: Columns | None = None
    alpha: Floats | None = None
    cutoff_hz: float = 11.0
    meeting_hz: float = 250.0
    memo: dict[tuple[str, int, float], Floats] = field(default_factory=dict, compare=False, repr=False)
    report_hz: float = PUBLISHED_CUTOFF_HZ

    @property
    def joints(self) -> int:
        return int(self.theta.shape[1])

    @property
    def rate_hz(self) -> float:
        return 1.0 / self.dt

    def along_axes(self, vector: Floats) -> Floats:
        """A vector in the base frame (N, 2) along the sensor's axes, (N, 2)."""
        assert self.sensor_angle is not None
        return rotated(vector, -self.sensor_angle)


def rotated(vector: Floats, angle: Floats) -> Floats:
    """(N, 2) turned counter-clockwise by (N,)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * vector[:, 0] - s * vector[:, 1], s * vector[:, 0] + c * vector[:, 1]], axis=1)


def rate_of(values: Floats, dt: float) -> Floats:
    """Fourth-order central difference along axis 0."""
    slope: Floats = np.gradient(values, dt, axis=0)
    slope[2:-2] = (values[:-4] - 8 * values[1:-3] + 8 * values[3:-1] - values[4:]) / (12 * dt)
    return slope


def with_motion(
    view: View, theta: Floats, omega: Floats, acc: Floats, model: RobotModel | None = None
) -> View:
    """The same trial had the joints moved otherwise than the encoders say, or had the robot other lengths."""
    model = model or view.model
    J = model.jacobian(theta)
    v = np.einsum("kij,kj->ki", J, omega)
    a = np.einsum("kij,kj->ki", J, acc) + np.einsum("kij,kj->ki", model.jacobian_rate(theta, omega), omega)
    angle, predicted = view.sensor_angle, view.predicted
    turn, turn_rate = view.turn, view.turn_rate
    if angle is not None and np.any(view.turn != 0):
        # The end-effector's angle is linear in the joints' angles.
        angle = angle + model.tip_angle(theta) - model.tip_angle(view.theta)
        turn, turn_rate = model.tip_turn(omega), model.tip_turn(acc)
    if angle is not None:
        predicted = rotated(a - np.array(model.plane_gravity_m_s2), -angle)
    return replace(
        view,
        theta=theta,
        omega=omega,
        acc=acc,
        x=model.position(theta),
        v=v,
        a=a,
        J=J,
        sensor_angle=angle,
        predicted=predicted,
        turn=turn,
        turn_rate=turn_rate,
        model=model,
        response=None,
        memo={},
    )


def advanced(values: Floats, t: Floats, delay_s: float | Floats) -> Floats:
    """Values (N, k) that came `delay_s` (one, or (N,)) late, put back to their instants (N,)."""
    result: Floats = Spline(t, values)(np.clip(t + delay_s, t[0], t[-1]))
    return result
