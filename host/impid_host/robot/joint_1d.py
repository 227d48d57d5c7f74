"""One rotary joint with the load on it: theta1 in rad, tau1 the measured torque that drives the load, N m."""

from dataclasses import dataclass
from typing import ClassVar

from impid_host.robot.single_axis import SingleAxis


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
