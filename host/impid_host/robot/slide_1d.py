"""One prismatic axis: theta1 is a position in m, tau1 a force in N."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from impid_host.signals.arrays import Floats


@dataclass(frozen=True, slots=True)
class Slide1D:
    """M q'' + Fv q' = tau; dry friction and a constant force are optional terms, not part of the model."""

    name: ClassVar[str] = "slide-1d"
    joints: ClassVar[int] = 1
    task_axes: ClassVar[tuple[str, ...]] = ("x",)
    parameter_names: ClassVar[tuple[str, ...]] = ("M", "Fv")
    parameter_units: ClassVar[tuple[str, ...]] = ("kg", "N*s/m")

    def regressor(self, theta: Floats, omega: Floats, theta_dd: Floats) -> Floats:  # noqa: ARG002
        """Y (N, 1, 2)."""
        return np.stack([theta_dd, omega], axis=2)

    def position(self, theta: Floats) -> Floats:
        """The axis is its own end-effector: (N, 1) -> (N, 1), m."""
        return theta

    def jacobian(self, theta: Floats) -> Floats:
        """(N, 1) -> (N, 1, 1), always 1."""
        return np.ones((len(theta), 1, 1))

    def jacobian_rate(self, theta: Floats, omega: Floats) -> Floats:  # noqa: ARG002
        """(N, 1) -> (N, 1, 1), always 0."""
        return np.zeros((len(theta), 1, 1))

    def inertia(self, theta: Floats, parameters: Floats) -> Floats:
        """(N, 1) -> (N, 1, 1), kg."""
        return np.full((len(theta), 1, 1), parameters[0])

    def coriolis(self, theta: Floats, omega: Floats, parameters: Floats) -> Floats:  # noqa: ARG002
        """(N, 1) -> (N, 1, 1), always 0."""
        return np.zeros((len(theta), 1, 1))
