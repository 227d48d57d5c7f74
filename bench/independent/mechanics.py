"""Two links whose angles are both measured from the base frame, and the loads at their end.

The second link's axis is e2 = (sin θ2, -cos θ2), the first's e1 = (cos θ1, sin θ1); the tip stands at
l1 e1 + l2 e2. With masses m_i at r_i along the links the kinetic energy is

    T = ½ α1 ω1² + ½ α3 ω2² - ½ α2 sin(θ1 - θ2) ω1 ω2,    α2 = 2 m2 l1 r2

and Lagrange's equations follow. All arrays have time along the first axis and two columns; SI units.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
GRAVITY = 9.80665


@dataclass(frozen=True)
class Robot:
    """Lengths in m, alpha as in the first paper (kg m², kg m², kg m², N m s, N m s), first moments in kg m."""

    lengths: tuple[float, float]
    alpha: tuple[float, ...]
    moments: tuple[float, float]

    def tip(self, theta: Array) -> Array:
        l1, l2 = self.lengths
        one, two = theta[:, 0], theta[:, 1]
        return np.column_stack([l1 * np.cos(one) + l2 * np.sin(two), l1 * np.sin(one) - l2 * np.cos(two)])

    def columns(self, theta: Array) -> tuple[Array, Array]:
        """The Jacobian's two columns, each (n, 2)."""
        l1, l2 = self.lengths
        one, two = theta[:, 0], theta[:, 1]
        return (
            l1 * np.column_stack([-np.sin(one), np.cos(one)]),
            l2 * np.column_stack([np.cos(two), np.sin(two)]),
        )

    def tip_rates(self, theta: Array, omega: Array, accel: Array) -> tuple[Array, Array]:
        """Velocity and acceleration of the tip."""
        first, second = self.columns(theta)
        l1, l2 = self.lengths
        one, two = theta[:, 0], theta[:, 1]
        inward = -l1 * np.column_stack([np.cos(one), np.sin(one)]) * omega[:, :1] ** 2
        inward += -l2 * np.column_stack([np.sin(two), -np.cos(two)]) * omega[:, 1:] ** 2
        velocity = first * omega[:, :1] + second * omega[:, 1:]
        return velocity, first * accel[:, :1] + second * accel[:, 1:] + inward

    def to_joints(self, theta: Array, force: Array) -> Array:
        """Jᵀ F."""
        first, second = self.columns(theta)
        return np.column_stack([(first * force).sum(1), (second * force).sum(1)])

    def solve(self, theta: Array, vector: Array) -> Array:
        """J⁻¹ of a Cartesian vector; singular where cos(θ1 - θ2) = 0."""
        first, second = self.columns(theta)
        det = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        return np.column_stack(
            [
                (second[:, 1] * vector[:, 0] - second[:, 0] * vector[:, 1]) / det,
                (-first[:, 1] * vector[:, 0] + first[:, 0] * vector[:, 1]) / det,
            ]
        )

    def to_tip(self, theta: Array, torque: Array) -> Array:
        """J⁻ᵀ of joint torques."""
        first, second = self.columns(theta)
        det = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        return np.column_stack(
            [
                (second[:, 1] * torque[:, 0] - first[:, 1] * torque[:, 1]) / det,
                (-second[:, 0] * torque[:, 0] + first[:, 0] * torque[:, 1]) / det,
            ]
        )

    def joint_accel(self, theta: Array, omega: Array, tip_accel: Array) -> Array:
        """Angular accelerations from the tip's acceleration."""
        _, inward = self.tip_rates(theta, omega, np.zeros_like(omega))
        return self.solve(theta, tip_accel - inward)

    def inertia_times(self, theta: Array, vector: Array) -> Array:
        a1, a2, a3 = self.alpha[:3]
        h = -0.5 * a2 * np.sin(theta[:, 0] - theta[:, 1])
        return np.column_stack([a1 * vector[:, 0] + h * vector[:, 1], h * vector[:, 0] + a3 * vector[:, 1]])

    def inverse(self, theta: Array, omega: Array, accel: Array) -> Array:
        """Torque that the motors deliver in free motion: inertia, centrifugal terms, viscous friction."""
        half = 0.5 * self.alpha[1] * np.cos(theta[:, 0] - theta[:, 1])
        turning = np.column_stack([half * omega[:, 1] ** 2, -half * omega[:, 0] ** 2])
        friction: Array = omega * np.array(self.alpha[3:])
        return self.inertia_times(theta, accel) + turning + friction

    def energy(self, theta: Array, omega: Array) -> Array:
        return np.asarray(0.5 * (omega * self.inertia_times(theta, omega)).sum(1))

    def hold(self, theta: Array, field_accel: Array) -> Array:
        """Torque that keeps the links up in a field of acceleration (m/s², (2,) or (n, 2))."""
        g = np.broadcast_to(field_accel, theta.shape)
        one, two = theta[:, 0], theta[:, 1]
        mu1, mu2 = self.moments
        return np.column_stack(
            [
                -mu1 * (-np.sin(one) * g[:, 0] + np.cos(one) * g[:, 1]),
                -mu2 * (np.cos(two) * g[:, 0] + np.sin(two) * g[:, 1]),
            ]
        )


@dataclass(frozen=True)
class Load:
    """M x'' + B x' + K (x - x0) is the force of the robot on the load; ``mass-spring`` or ``arm``."""

    name: str
    kind: str
    M: Array
    B: Array
    K: Array
    x0: Array
    handle: float = 0.0
    payload: float | None = field(default=None)

    @property
    def moved(self) -> Array:
        """Mass matrix of all that sits beyond the force sensor."""
        return self.M + self.handle * np.eye(2)

    def force(self, x: Array, v: Array, a: Array) -> Array:
        """Force of the load on the robot, N."""
        return -(a @ self.moved.T + v @ self.B.T + (x - self.x0) @ self.K.T)
