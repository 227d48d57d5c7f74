"""One prismatic axis: theta1 is a position in m, tau1 a force in N."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from impid_host.robot.single_axis import SingleAxis
from impid_host.signals.arrays import Floats


@dataclass(frozen=True, slots=True)
class Slide1D(SingleAxis):
    """M q'' + Fv q' = tau; dry friction and a constant force are optional terms, not part of the model."""

    name: ClassVar[str] = "slide-1d"
    joints: ClassVar[int] = 1
    prismatic: ClassVar[tuple[bool, ...]] = (True,)
    task_axes: ClassVar[tuple[str, ...]] = ("x",)
    parameter_names: ClassVar[tuple[str, ...]] = ("M", "Fv")
    parameter_units: ClassVar[tuple[str, ...]] = ("kg", "N*s/m")
    task_is_rotary: ClassVar[bool] = False
    torque_at_load: ClassVar[bool] = False
    baseline: ClassVar[str] = "textbook"
    gravity_parameters: ClassVar[tuple[str, ...]] = ()

    def gravity_regressor(self, theta: Floats) -> Floats:
        """A slope adds a constant force, which no gravity term is needed for: (N, 1) -> (N, 1, 0)."""
        return np.zeros((len(theta), 1, 0))
