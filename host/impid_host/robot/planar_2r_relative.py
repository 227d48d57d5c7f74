"""Two revolute joints, the second angle measured from the first link; gravity in the plane, if any."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from impid_host.signals.arrays import Floats

_BASE = ("ZZ1R", "ZZ2", "MX2", "MY2")
_GRAVITY = ("MX1R", "MY1")
_FRICTION = ("Fv1", "Fv2")


@dataclass(frozen=True, slots=True)
class Planar2RRelative:
    """Minimal (base) parameters of the planar two-link arm (Gautier and Khalil's regrouping).

    With J1, J2 the links' inertias about their joints, m2 the second mass and (MX, MY) the first moments in
    link frames: ZZ1R = J1 + m2 l1^2, ZZ2 = J2, MX2, MY2; with gravity also MX1R = MX1 + m2 l1 and MY1.
    Viscous friction Fv1, Fv2. x = l1 cos q1 + l2 cos(q1 + q2), y = l1 sin q1 + l2 sin(q1 + q2).

    Args:
        l1, l2: link lengths, m.
        gravity_m_s2: gravity's components in the base frame, m/s^2.
    """

    l1: float
    l2: float
    gravity_m_s2: tuple[float, float] = (0.0, 0.0)

    name: ClassVar[str] = "planar-2r-relative"
    joints: ClassVar[int] = 2
    prismatic: ClassVar[tuple[bool, ...]] = (False, False)
    task_axes: ClassVar[tuple[str, ...]] = ("x", "y")
    task_is_rotary: ClassVar[bool] = False
    torque_at_load: ClassVar[bool] = False
    baseline: ClassVar[str] = "textbook"

    @property
    def link_lengths_m(self) -> tuple[float, ...]:
        """l1, l2."""
        return (self.l1, self.l2)

    def with_links(self, lengths_m: tuple[float, ...]) -> "Planar2RRelative":
        """The same robot with other link lengths."""
        return replace(self, l1=lengths_m[0], l2=lengths_m[1])

    def first_moments(self, theta: Floats, parameters: Floats) -> Floats | None:  # noqa: ARG002
        """None: the inertias of this form do not tell the first link's moment."""
        return None

    link_inertias: ClassVar[Floats | None] = None
    parameter_meanings: ClassVar[dict[str, str]] = {}

    @property
    def has_gravity(self) -> bool:
        """Gravity acts in the plane."""
        return self.gravity_m_s2 != (0.0, 0.0)

    @property
    def gravity_parameters(self) -> tuple[str, ...]:
        """Without declared gravity: sine and cosine of each link's own angle from the base frame."""
        return () if self.has_gravity else ("gs1", "gc1", "gs2", "gc2")

    @property
    def plane_gravity_m_s2(self) -> tuple[float, float]:
        """Gravity's components in the base frame, m/s^2."""
        return self.gravity_m_s2

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Without gravity its two parameters move nothing, and are left out."""
        return _BASE + (_GRAVITY if self.has_gravity else ()) + _FRICTION

    @property
    def nonnegative(self) -> tuple[bool, ...]:
        """Inertias and friction; first moments have either sign."""
        return tuple(name.startswith(("ZZ", "Fv")) for name in self.parameter_names)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units in the order of the names."""
        gravity = ("kg*m", "kg*m") if self.has_gravity else ()
        return ("kg*m^2", "kg*m^2", "kg*m", "kg*m", *gravity, "N*m*s/rad", "N*m*s/rad")

    def regressor(self, theta: Floats, omega: Floats, theta_dd: Floats) -> Floats:
        """Y (N, 2, p), Lagrange's equations with w = q1' + q2' of

        T = 1/2 ZZ1R q1'^2 + 1/2 ZZ2 w^2 + l1 q1' w (MX2 cos q2 - MY2 sin q2).
        """
        q1, q2 = theta.T
        v1, v2 = omega.T
        a1, a2 = theta_dd.T
        c2, s2 = np.cos(q2), np.sin(q2)
        zero = np.zeros_like(q1)
        total = 2 * a1 + a2
        swirl = (2 * v1 + v2) * v2
        row1 = [a1, a1 + a2, self.l1 * (total * c2 - swirl * s2), -self.l1 * (total * s2 + swirl * c2)]
        row2 = [zero, a1 + a2, self.l1 * (a1 * c2 + v1**2 * s2), self.l1 * (-a1 * s2 + v1**2 * c2)]
        if self.has_gravity:
            gx, gy = self.gravity_m_s2
            c1, s1, c12, s12 = np.cos(q1), np.sin(q1), np.cos(q1 + q2), np.sin(q1 + q2)
            along, across = gx * s12 - gy * c12, gx * c12 + gy * s12
            row1[2], row2[2] = row1[2] + along, row2[2] + along
            row1[3], row2[3] = row1[3] + across, row2[3] + across
            row1 += [gx * s1 - gy * c1, gx * c1 + gy * s1]
            row2 += [zero, zero]
        row1 += [v1, zero]
        row2 += [zero, v2]
        return np.stack([np.stack(row1, axis=1), np.stack(row2, axis=1)], axis=1)

    def gravity_regressor(self, theta: Floats) -> Floats:
        """The second link's weight pulls at both joints: (N, 2) -> (N, 2, 4)."""
        Y = np.zeros((len(theta), 2, 0 if self.has_gravity else 4))
        if not self.has_gravity:
            q12 = theta[:, 0] + theta[:, 1]
            Y[:, 0] = np.stack([np.sin(theta[:, 0]), np.cos(theta[:, 0]), np.sin(q12), np.cos(q12)], axis=1)
            Y[:, 1, 2:] = Y[:, 0, 2:]
        return Y

    def position(self, theta: Floats) -> Floats:
        """(N, 2) rad -> (N, 2) m."""
        q1, q12 = theta[:, 0], theta[:, 0] + theta[:, 1]
        x = self.l1 * np.cos(q1) + self.l2 * np.cos(q12)
        y = self.l1 * np.sin(q1) + self.l2 * np.sin(q12)
        return np.stack([x, y], axis=1)

    def jacobian(self, theta: Floats) -> Floats:
        """(N, 2) -> (N, 2, 2), m/rad."""
        q1, q12 = theta[:, 0], theta[:, 0] + theta[:, 1]
        s1, c1 = self.l1 * np.sin(q1), self.l1 * np.cos(q1)
        s12, c12 = self.l2 * np.sin(q12), self.l2 * np.cos(q12)
        return np.moveaxis(np.array([[-s1 - s12, -s12], [c1 + c12, c12]]), 2, 0)

    def jacobian_rate(self, theta: Floats, omega: Floats) -> Floats:
        """(N, 2) twice -> (N, 2, 2), m/(rad s)."""
        q1, q12 = theta[:, 0], theta[:, 0] + theta[:, 1]
        v1, w = omega[:, 0], omega[:, 0] + omega[:, 1]
        s1, c1 = self.l1 * np.sin(q1) * v1, self.l1 * np.cos(q1) * v1
        s12, c12 = self.l2 * np.sin(q12) * w, self.l2 * np.cos(q12) * w
        return np.moveaxis(np.array([[-c1 - c12, -c12], [-s1 - s12, -s12]]), 2, 0)

    def tip_angle(self, theta: Floats) -> Floats:
        """x' lies along the second link: (N, 2) -> (N,), rad."""
        return np.asarray(theta[:, 0] + theta[:, 1])

    def tip_turn(self, omega: Floats) -> Floats:
        """(N, 2) -> (N,), rad/s."""
        return np.asarray(omega[:, 0] + omega[:, 1])

    def inertia(self, theta: Floats, parameters: Floats) -> Floats:
        """(N, 2) -> (N, 2, 2), kg m^2."""
        zz1, zz2, mx2, my2 = parameters[:4]
        shared = self.l1 * (mx2 * np.cos(theta[:, 1]) - my2 * np.sin(theta[:, 1]))
        corner = np.full_like(shared, zz2)
        return np.moveaxis(np.array([[zz1 + zz2 + 2 * shared, zz2 + shared], [zz2 + shared, corner]]), 2, 0)

    def coriolis(self, theta: Floats, omega: Floats, parameters: Floats) -> Floats:
        """Christoffel form: (N, 2) twice -> (N, 2, 2)."""
        _, _, mx2, my2 = parameters[:4]
        slope = -self.l1 * (mx2 * np.sin(theta[:, 1]) + my2 * np.cos(theta[:, 1]))
        v1, v2 = omega.T
        return np.moveaxis(np.array([[slope * v2, slope * (v1 + v2)], [-slope * v1, 0 * slope]]), 2, 0)
