"""One prismatic axis: theta1 is a position in m, tau1 a force in N."""

from dataclasses import dataclass
from typing import ClassVar

from impid_host.robot.single_axis import SingleAxis


@dataclass(frozen=True, slots=True)
class Slide1D(SingleAxis):
    """M q'' + Fv q' = tau; dry friction and a constant force are optional terms, not part of the model."""

    name: ClassVar[str] = "slide-1d"
    joints: ClassVar[int] = 1
    prismatic: ClassVar[tuple[bool, ...]] = (True,)
    task_axes: ClassVar[tuple[str, ...]] = ("x",)
    parameter_names: ClassVar[tuple[str, ...]] = ("M", "Fv")
    parameter_units: ClassVar[tuple[str, ...]] = ("kg", "N*s/m")
