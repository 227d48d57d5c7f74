"""One rotary joint with the load on it: theta1 in rad, tau1 the measured torque that drives the load, N m."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from impid_host.robot.single_axis import SingleAxis
from impid_host.signals.arrays import Floats


@dataclass(frozen=True, slots=True)
class Joint1D(SingleAxis):
    """I theta'' + B theta' = tau for what the torque sensor carries besides the load (a footplate, a lever).

    It is found from free trials, where there are any; without them nothing stands between sensor and load.
    """

    name: ClassVar[str] = "joint-1d"
    joints: ClassVar[int] = 1
    prismatic: ClassVar[tuple[bool, ...]] = (False,)
    task_axes: ClassVar[tuple[str, ...]] = ("theta",)
    parameter_names: ClassVar[tuple[str, ...]] = ("I", "B")
    parameter_units: ClassVar[tuple[str, ...]] = ("kg*m^2", "N*m*s/rad")
    task_is_rotary: ClassVar[bool] = True
    torque_at_load: ClassVar[bool] = True
    baseline: ClassVar[str] = "papers"
    gravity_parameters: ClassVar[tuple[str, ...]] = ("gs", "gc")

    def gravity_regressor(self, theta: Floats) -> Floats:
        """Sine and cosine of the angle, whatever its zero and the axis's tilt: (N, 1) -> (N, 1, 2)."""
        return np.stack([np.sin(theta), np.cos(theta)], axis=2)
