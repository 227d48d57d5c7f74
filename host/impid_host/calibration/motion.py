"""What the encoders of a recording say about the acceleration of the board."""

import numpy as np

from impid_host.calibration.accelerometer import Floats
from impid_host.calibration.in_place import second_derivative
from impid_host.errors import InputError
from impid_host.robot.model import robot_model
from impid_host.samples import DeviceSamples
from impid_host.signals.align import base_frame_acceleration, sensor_angle
from impid_host.signals.counts import joint_angles
from impid_host.study.model import Setup

STANDARD_GRAVITY_M_S2 = 9.80665  # BIPM, SI brochure


def predicted_specific_force(device: DeviceSamples, setup: Setup, rate_hz: float) -> Floats:
    """Specific force along the board's axes as the encoders imply it, unfiltered, g, (N, 2).

    The board is at the end point, as the setup mounts it; gravity is in it where the robot model has it.

    Raises:
        InputError: the setup describes no encoder or no accelerometer.
    """
    if setup.encoder is None or setup.accelerometer is None:
        raise InputError(
            "setup.toml",
            "lacks [encoder] or [accelerometer]",
            "describe both: calibration in place compares the two",
        )
    theta = joint_angles(device, setup.encoder)
    model = robot_model(setup.robot)
    base = second_derivative(model.position(theta), rate_hz) - np.array(model.plane_gravity_m_s2)
    angle = sensor_angle(theta, setup.accelerometer, model)
    # The base frame's axes seen from the board: the columns of the rotation, transposed.
    axes = np.eye(2)
    columns = [base_frame_acceleration(np.tile(axis, (len(theta), 1)), angle) for axis in axes]
    along = [np.einsum("ni,ni->n", column, base) for column in columns]
    result: Floats = np.stack(along, axis=1) / STANDARD_GRAVITY_M_S2
    return result
