"""The main robot of [D]: two revolute joints, both angles measured from the base frame."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from impid_host.signals.arrays import Floats


@dataclass(frozen=True, slots=True)
class Planar2RAbsolute:
    """[D] eqs. 1 and 11 to 13; x = l1 cos t1 + l2 sin t2, y = l1 sin t1 - l2 cos t2.

    I = [[a1, h], [h, a3]], h = -1/2 a2 sin(t1 - t2); friction [a4 w1, a5 w2]. The second row of C is
    -1/2 a2 cos(t1 - t2) w1: eq. 12 prints it with a plus, and that robot would not conserve energy.

    Args:
        l1, l2: link lengths, m.
    """

    l1: float
    l2: float

    name: ClassVar[str] = "planar-2r-absolute"
    joints: ClassVar[int] = 2
    prismatic: ClassVar[tuple[bool, ...]] = (False, False)
    plane_gravity_m_s2: ClassVar[tuple[float, float]] = (0.0, 0.0)
    task_axes: ClassVar[tuple[str, ...]] = ("x", "y")
    task_is_rotary: ClassVar[bool] = False
    torque_at_load: ClassVar[bool] = False
    baseline: ClassVar[str] = "papers"
    has_gravity: ClassVar[bool] = False
    link_inertias: ClassVar[Floats | None] = None
    parameter_meanings: ClassVar[dict[str, str]] = {}
    nonnegative: ClassVar[tuple[bool, ...]] = (True, False, True, True, True)
    gravity_parameters: ClassVar[tuple[str, ...]] = ("gs1", "gc1", "gs2", "gc2")
    parameter_names: ClassVar[tuple[str, ...]] = ("alpha1", "alpha2", "alpha3", "alpha4", "alpha5")
    parameter_units: ClassVar[tuple[str, ...]] = ("kg*m^2", "kg*m^2", "kg*m^2", "N*m*s/rad", "N*m*s/rad")

    @property
    def link_lengths_m(self) -> tuple[float, ...]:
        """l1, l2."""
        return (self.l1, self.l2)

    def with_links(self, lengths_m: tuple[float, ...]) -> "Planar2RAbsolute":
        """The same robot with other link lengths."""
        return replace(self, l1=lengths_m[0], l2=lengths_m[1])

    def first_moments(self, theta: Floats, parameters: Floats) -> Floats:
        """Torque per unit of gravity along x and y, by the moments that the inertias tell: (N, 2, 2).

        The second link's is alpha2 / (2 l1); the first link's is that of a mass at its end.
        """
        c, s = np.cos(theta), np.sin(theta)
        first, second = parameters[0] / self.l1, parameters[1] / (2.0 * self.l1)
        rows = [[first * s[:, 0], -first * c[:, 0]], [-second * c[:, 1], -second * s[:, 1]]]
        return np.moveaxis(np.array(rows), 2, 0)

    def regressor(self, theta: Floats, omega: Floats, theta_dd: Floats) -> Floats:
        """Y (N, 2, 5) with I theta'' + C theta' + F_r = Y alpha."""
        half_sin = 0.5 * np.sin(theta[:, 0] - theta[:, 1])
        half_cos = 0.5 * np.cos(theta[:, 0] - theta[:, 1])
        Y = np.zeros((len(theta), 2, 5))
        Y[:, 0, 0] = theta_dd[:, 0]
        Y[:, 0, 1] = -half_sin * theta_dd[:, 1] + half_cos * omega[:, 1] ** 2
        Y[:, 0, 3] = omega[:, 0]
        Y[:, 1, 1] = -half_sin * theta_dd[:, 0] - half_cos * omega[:, 0] ** 2
        Y[:, 1, 2] = theta_dd[:, 1]
        Y[:, 1, 4] = omega[:, 1]
        return Y

    def gravity_regressor(self, theta: Floats) -> Floats:
        """Sine and cosine of each absolute angle on its own joint: (N, 2) -> (N, 2, 4)."""
        Y = np.zeros((len(theta), 2, 4))
        for joint in range(2):
            Y[:, joint, 2 * joint] = np.sin(theta[:, joint])
            Y[:, joint, 2 * joint + 1] = np.cos(theta[:, joint])
        return Y

    def position(self, theta: Floats) -> Floats:
        """(N, 2) rad -> (N, 2) m."""
        t1, t2 = theta[:, 0], theta[:, 1]
        x = self.l1 * np.cos(t1) + self.l2 * np.sin(t2)
        y = self.l1 * np.sin(t1) - self.l2 * np.cos(t2)
        return np.stack([x, y], axis=1)

    def jacobian(self, theta: Floats) -> Floats:
        """(N, 2) -> (N, 2, 2), m/rad."""
        t1, t2 = theta[:, 0], theta[:, 1]
        rows = [
            [-self.l1 * np.sin(t1), self.l2 * np.cos(t2)],
            [self.l1 * np.cos(t1), self.l2 * np.sin(t2)],
        ]
        return np.moveaxis(np.array(rows), 2, 0)

    def jacobian_rate(self, theta: Floats, omega: Floats) -> Floats:
        """(N, 2) twice -> (N, 2, 2), m/(rad s)."""
        t1, t2 = theta[:, 0], theta[:, 1]
        w1, w2 = omega[:, 0], omega[:, 1]
        rows = [
            [-self.l1 * np.cos(t1) * w1, -self.l2 * np.sin(t2) * w2],
            [-self.l1 * np.sin(t1) * w1, self.l2 * np.cos(t2) * w2],
        ]
        return np.moveaxis(np.array(rows), 2, 0)

    def tip_angle(self, theta: Floats) -> Floats:
        """x' = (cos t2, sin t2): (N, 2) -> (N,), rad."""
        return np.asarray(theta[:, 1])

    def tip_turn(self, omega: Floats) -> Floats:
        """(N, 2) -> (N,), rad/s."""
        return np.asarray(omega[:, 1])

    def inertia(self, theta: Floats, parameters: Floats) -> Floats:
        """[D] eq. 11: (N, 2) -> (N, 2, 2), kg m^2."""
        a1, a2, a3 = parameters[:3]
        h = -0.5 * a2 * np.sin(theta[:, 0] - theta[:, 1])
        return np.moveaxis(np.array([[np.full_like(h, a1), h], [h, np.full_like(h, a3)]]), 2, 0)

    def coriolis(self, theta: Floats, omega: Floats, parameters: Floats) -> Floats:
        """[D] eq. 12 with the sign that conserves energy: (N, 2) twice -> (N, 2, 2)."""
        c = 0.5 * parameters[1] * np.cos(theta[:, 0] - theta[:, 1])
        zero = np.zeros_like(c)
        return np.moveaxis(np.array([[zero, c * omega[:, 1]], [-c * omega[:, 0], zero]]), 2, 0)
