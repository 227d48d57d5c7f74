"""The virtual force sensor: [D] eq. 1 solved for F_ext, the force of the load on the robot."""

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.robot.model import RobotModel
from impid_host.signals.arrays import Floats
from impid_host.signals.systems import solved


def through_jacobian(model: RobotModel, theta: Floats, joint_side: Floats) -> Floats:
    """J^-T applied to joint-side quantities: (N, n) or (N, n, p) -> (N, d) or (N, d, p).

    With more joints than axes it is the least-squares inverse.

    Raises:
        UndeterminedError: fewer joints than axes.
    """
    J_T: Floats = np.swapaxes(model.jacobian(theta), 1, 2)
    columns = joint_side[:, :, None] if joint_side.ndim == 2 else joint_side
    n, d = J_T.shape[1:]
    if n < d:
        raise UndeterminedError(f"{n} joint torque(s) do not determine a force along {d} axes")
    inverse = solved(J_T, columns) if n == d else np.linalg.pinv(J_T) @ columns
    result: Floats = np.asarray(inverse, dtype=np.float64)
    return result[:, :, 0] if joint_side.ndim == 2 else result


def beyond_force(model: RobotModel, theta: Floats, joint_side: Floats) -> Floats:
    """What of an external torque (N, n) no force at the end-effector makes, (N, n).

    With more joints than axes the force is that of least squares; moments at the end-effector and pushes at
    the links leave a rest, in the null space of J.
    """
    J = model.jacobian(theta)
    force = through_jacobian(model, theta, joint_side)
    return np.asarray(joint_side - np.einsum("kij,ki->kj", J, force))


def external_force(model: RobotModel, theta: Floats, Y: Floats, parameters: Floats, tau: Floats) -> Floats:
    """F_ext = J^-T (I theta'' + C theta' + F_r - tau), N, (N, d).

    [D] eq. 2 prints the opposite sign, which contradicts its eqs. 1 and 3.

    Args:
        Y: the robot's regressor along the motion, (N, n, p).
        parameters: (p,).
        tau: joint torques, (N, n).
    """
    return through_jacobian(model, theta, Y @ parameters - tau)
