"""Geometry of the two-link arm with absolute angles.

    x = l1 cos q1 + l2 sin q2
    y = l1 sin q1 - l2 cos q2

the form under which the inertia matrix of [D] eq. 11 follows from the kinetic energy. The end-effector
turns with q2.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


QUARTER_TURN = np.pi / 2


def joints_of(q: Array, *, relative: bool) -> Array:
    """Angles of the joints, as encoders see them, from those of the links, shape (..., 2), rad.

    A relative second joint stands at zero where the second link goes on along the first.
    """
    return np.stack([q[..., 0], q[..., 1] - q[..., 0] - QUARTER_TURN], axis=-1) if relative else q


def links_of(p: Array, *, relative: bool) -> Array:
    """Angles of the links from those of the joints; the inverse of `joints_of`."""
    return np.stack([p[..., 0], p[..., 0] + p[..., 1] + QUARTER_TURN], axis=-1) if relative else p


def position(q: Array, link_lengths_m: tuple[float, float]) -> Array:
    """Place of the end-effector.

    Args:
        q: angles of the links, shape (..., 2), rad.
        link_lengths_m: l1, l2.

    Returns:
        x and y in the base frame, shape (..., 2), m.
    """
    l1, l2 = link_lengths_m
    q1, q2 = q[..., 0], q[..., 1]
    return np.stack([l1 * np.cos(q1) + l2 * np.sin(q2), l1 * np.sin(q1) - l2 * np.cos(q2)], axis=-1)


def joint_angles(x: Array, link_lengths_m: tuple[float, float]) -> Array:
    """Joint angles that put the end-effector at x, on the branch with cos(q1 - q2) > 0.

    On that branch the Jacobian's determinant, -l1 l2 cos(q1 - q2), does not change its sign.

    Args:
        x: place in the base frame, shape (2,), m.
        link_lengths_m: l1, l2.

    Returns:
        q1 and q2, shape (2,), rad.

    Raises:
        ValueError: the place is out of reach.
    """
    l1, l2 = link_lengths_m
    r2 = float(x[0] ** 2 + x[1] ** 2)
    # |x|^2 = l1^2 + l2^2 + 2 l1 l2 sin(q2 - q1)
    sine = (r2 - l1**2 - l2**2) / (2.0 * l1 * l2)
    if abs(sine) >= 1.0:
        raise ValueError(f"({x[0]:.4g}, {x[1]:.4g}) m is out of reach of links of {l1:g} and {l2:g} m")
    bend = np.arcsin(sine)
    # With q2 = q1 + bend the second link stands at angle bend - 90 degrees to the first.
    along, across = l1 + l2 * sine, -l2 * np.cos(bend)
    q1 = np.arctan2(x[1], x[0]) - np.arctan2(across, along)
    return np.array([q1, q1 + bend])
