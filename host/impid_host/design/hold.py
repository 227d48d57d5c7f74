"""The weak controller that keeps the hand near the test location while it is shaken.

Source: [P] eq. 2, whose print differentiates the velocity once too often; F_c = F_delta - kp (d - d_des) - kd
v holds. [P] Sec. II-A gives the velocity: backward differences through a first-order Butterworth filter at 20
Hz.
"""

import numpy as np

from impid_host.impedance.spectral.arrays import Floats
from impid_host.signals.recursive import butterworth_sections, recursive

VELOCITY_CUTOFF_HZ = 20.0


def hold_force(F_delta: Floats, d: Floats, d_des: Floats, v: Floats, *, kp: float, kd: float) -> Floats:
    """Commanded force at the end-effector (N), shape (N, n).

    Args:
        F_delta: perturbation (N), shape (N, n).
        d: position (m), shape (N, n).
        d_des: test location (m), shape (n,).
        v: velocity (m/s), shape (N, n).
        kp: N/m. Higher gains hold the place better and pass less of the perturbation on to the arm.
        kd: N s/m.
    """
    return F_delta - kp * (d - d_des) - kd * v


def measured_velocity(d: Floats, fs: float) -> Floats:
    """[P]'s velocity: backward difference, then a causal first-order low-pass at 20 Hz; (N, n) m -> (N, n)
    m/s.
    """
    difference = np.diff(d, axis=0, prepend=d[:1]) * fs
    return recursive(butterworth_sections(1, VELOCITY_CUTOFF_HZ, fs), difference, settled=False)
