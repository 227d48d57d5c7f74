"""What every robot of one axis shares: the axis is its own task coordinate, and nothing turns."""

from typing import ClassVar, Self

import numpy as np

from impid_host.signals.arrays import Floats


class SingleAxis:
    """Inertia times acceleration plus viscous friction times velocity; N instants, SI units of the axis."""

    __slots__ = ()

    plane_gravity_m_s2: ClassVar[tuple[float, float]] = (0.0, 0.0)
    has_gravity: ClassVar[bool] = False
    link_inertias: ClassVar[Floats | None] = None
    parameter_meanings: ClassVar[dict[str, str]] = {}
    nonnegative: ClassVar[tuple[bool, ...]] = (True, True)

    @property
    def link_lengths_m(self) -> tuple[float, ...]:
        """None declared."""
        return ()

    def with_links(self, lengths_m: tuple[float, ...]) -> Self:  # noqa: ARG002
        """The robot itself: it has no declared lengths."""
        return self

    def first_moments(self, theta: Floats, parameters: Floats) -> Floats | None:  # noqa: ARG002
        """None: no arm in a plane."""
        return None

    def regressor(self, theta: Floats, omega: Floats, theta_dd: Floats) -> Floats:  # noqa: ARG002
        """Y (N, 1, 2)."""
        return np.stack([theta_dd, omega], axis=2)

    def position(self, theta: Floats) -> Floats:
        """The axis is its own end-effector: (N, 1) -> (N, 1), rad or m."""
        return theta

    def jacobian(self, theta: Floats) -> Floats:
        """(N, 1) -> (N, 1, 1), always 1."""
        return np.ones((len(theta), 1, 1))

    def jacobian_rate(self, theta: Floats, omega: Floats) -> Floats:  # noqa: ARG002
        """(N, 1) -> (N, 1, 1), always 0."""
        return np.zeros((len(theta), 1, 1))

    def tip_angle(self, theta: Floats) -> Floats:
        """An axis carries no accelerometer that turns: (N, 1) -> (N,), always 0."""
        return np.zeros(len(theta))

    def tip_turn(self, omega: Floats) -> Floats:
        """(N, 1) -> (N,), always 0."""
        return np.zeros(len(omega))

    def inertia(self, theta: Floats, parameters: Floats) -> Floats:
        """(N, 1) -> (N, 1, 1), kg m^2 or kg."""
        return np.full((len(theta), 1, 1), parameters[0])

    def coriolis(self, theta: Floats, omega: Floats, parameters: Floats) -> Floats:  # noqa: ARG002
        """(N, 1) -> (N, 1, 1), always 0."""
        return np.zeros((len(theta), 1, 1))
