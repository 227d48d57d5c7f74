"""One rotary joint with the load on it: theta1 in rad, tau1 the measured torque that drives the load, N m."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from impid_host.signals.arrays import Floats


@dataclass(frozen=True, slots=True)
class Joint1D:
    """I theta'' + B theta' = tau for what the torque sensor carries besides the load (a footplate, a lever).

    It is found from free trials, where there are any; without them nothing stands between sensor and load.
    """

    name: ClassVar[str] = "joint-1d"
    joints: ClassVar[int] = 1
    task_axes: ClassVar[tuple[str, ...]] = ("theta",)
    parameter_names: ClassVar[tuple[str, ...]] = ("I", "B")
    parameter_units: ClassVar[tuple[str, ...]] = ("kg*m^2", "N*m*s/rad")

    def regressor(self, theta: Floats, omega: Floats, theta_dd: Floats) -> Floats:  # noqa: ARG002
        """Y (N, 1, 2)."""
        return np.stack([theta_dd, omega], axis=2)

    def position(self, theta: Floats) -> Floats:
        """The joint's angle is its own task coordinate: (N, 1) -> (N, 1), rad."""
        return theta

    def jacobian(self, theta: Floats) -> Floats:
        """(N, 1) -> (N, 1, 1), always 1."""
        return np.ones((len(theta), 1, 1))

    def jacobian_rate(self, theta: Floats, omega: Floats) -> Floats:  # noqa: ARG002
        """(N, 1) -> (N, 1, 1), always 0."""
        return np.zeros((len(theta), 1, 1))

    def inertia(self, theta: Floats, parameters: Floats) -> Floats:
        """(N, 1) -> (N, 1, 1), kg m^2."""
        return np.full((len(theta), 1, 1), parameters[0])

    def coriolis(self, theta: Floats, omega: Floats, parameters: Floats) -> Floats:  # noqa: ARG002
        """(N, 1) -> (N, 1, 1), always 0."""
        return np.zeros((len(theta), 1, 1))
