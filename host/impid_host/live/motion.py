"""Speeds of the joints as they move: the angles' slow part, the accelerometer's quick part, no delay between.

Each joint is followed by angle, speed and a third state, by which its acceleration differs from the
measured one (a zero that has moved, gravity by a tilt). What the angle shows of them corrects all three, as
a polynomial of second order fitted with a memory that fades (Morrison 1969): stable at any rate. Without an
accelerometer the third state is the acceleration itself.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.signals.arrays import Floats


@dataclass(frozen=True, slots=True)
class Motion:
    """Where the joints are after a row.

    Attributes:
        t: of the row, s.
        angle, speed: rad (m) and s, (n,); measured: acceleration as it was measured; lacking: what it lacks.
    """

    t: float
    angle: Floats
    speed: Floats
    measured: Floats
    lacking: Floats

    def by_angles(self) -> "Motion":
        """The same where no acceleration is measured any more."""
        total = self.measured + self.lacking
        return Motion(self.t, self.angle, self.speed, np.zeros_like(total), total)

    def by_accelerometer(self, measured: Floats) -> "Motion":
        """The same where it is measured from now on."""
        return Motion(self.t, self.angle, self.speed, measured, np.zeros_like(measured))


def follow(
    before: Motion | None, t: Floats, theta: Floats, measured: Floats, memory_s: float
) -> tuple[Floats, Motion]:
    """Speeds (N, n) at each row, and where the joints then are.

    Args:
        before: after the row before; None: at rest.
        t: s, increasing, (N,), N at least 1; theta: angles, (N, n).
        measured: acceleration, (N, n); zero where nothing measures it.
        memory_s: how long an angle counts.
    """
    if before is None:
        still = np.zeros_like(theta[0])
        before = Motion(float(t[0]), theta[0], still, measured[0], still)
    steps = np.diff(t, prepend=before.t)
    mean = 0.5 * (measured + np.concatenate([before.measured[None], measured[:-1]]))
    fade = np.exp(-steps / memory_s)
    left = 1.0 - fade
    to_angle = 1.0 - fade**3
    over = np.divide(1.0, steps, out=np.zeros_like(steps), where=steps > 0)
    to_speed = 1.5 * left**2 * (1.0 + fade) * over
    to_rest = left**3 * over**2
    gains = np.stack([steps, to_angle, to_speed, to_rest], axis=1).tolist()
    omega = np.empty_like(theta)
    state = [before.angle.tolist(), before.speed.tolist(), before.lacking.tolist()]
    # Plain numbers: a row has two joints, and an array of two costs fifty times as much as two numbers.
    for joint in range(theta.shape[1]):
        angle, speed, lacking = (part[joint] for part in state)
        seen, pushed = theta[:, joint].tolist(), mean[:, joint].tolist()
        speeds = []
        for (dt, g_angle, g_speed, g_rest), where, acc in zip(gains, seen, pushed, strict=True):
            total = acc + lacking
            angle += dt * (speed + 0.5 * dt * total)
            speed += dt * total
            error = where - angle
            angle += g_angle * error
            speed += g_speed * error
            lacking += g_rest * error
            speeds.append(speed)
        omega[:, joint] = speeds
        state[0][joint], state[1][joint], state[2][joint] = angle, speed, lacking
    return omega, Motion(
        float(t[-1]), np.array(state[0]), np.array(state[1]), measured[-1], np.array(state[2])
    )
