"""Linear model of robot and arm in contact, and the perturbation that undoes what the contact does to the
force.

Source: [P] eqs. 3 to 5. The eight states are q = [theta_s, theta_e, theta_s', theta_e', x, y, x', y'],
deviations
from rest: two robot joints and the hand, joined by a "virtual force transducer", a stiff spring with a
damper.

    I theta'' + D theta' = J^T (F_c - F)        robot at rest: no Coriolis terms, no static joint load
    M d'' + B d' + K d   = F                    arm or load
    F   = k_t (J theta - d) + b_t (J theta' - d')
    F_c = F_delta - kp J theta - kd J theta'

[P] has no actuator states, and its eight leave no room for any.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from impid_host.impedance.spectral.arrays import Complexes, Floats

# Far stiffer than any arm, as a six-axis transducer is; its damping is 10 % of critical for 1 kg.
TRANSDUCER_STIFFNESS_N_M = 1.0e6
TRANSDUCER_DAMPING_N_S_M = 200.0
SILENCE_AFTER_S = 60.0


@dataclass(frozen=True, slots=True)
class Contact:
    """Robot, hold controller and arm at one test location.

    Attributes:
        inertia: I, joint inertia (kg m^2), shape (2, 2).
        friction: D, viscous joint friction (N m s/rad), shape (2, 2).
        jacobian: J (m/rad), shape (2, 2).
        kp, kd: of the hold controller, N/m and N s/m.
        M, B, K: of the arm or load, kg, N s/m, N/m, shape (2, 2) each.
        k_t, b_t: of the transducer, N/m and N s/m.
    """

    inertia: Floats
    friction: Floats
    jacobian: Floats
    kp: float
    kd: float
    M: Floats
    B: Floats
    K: Floats
    k_t: float = TRANSDUCER_STIFFNESS_N_M
    b_t: float = TRANSDUCER_DAMPING_N_S_M

    def state_space(self) -> tuple[Floats, Floats, Floats, Floats]:
        """A_T (8, 8), B_T (8, 2), C_T (2, 8), D_T (2, 2) of [P] eq. 3, from F_delta (N) to F (N)."""
        J, one, zero = self.jacobian, np.eye(2), np.zeros((2, 2))
        C_T = np.hstack([self.k_t * J, self.b_t * J, -self.k_t * one, -self.b_t * one])
        hold = np.hstack([-self.kp * J, -self.kd * J, zero, zero])
        friction = np.hstack([zero, self.friction, zero, zero])
        arm = np.hstack([zero, zero, self.K, self.B])
        A_T = np.vstack(
            [
                np.hstack([zero, one, zero, zero]),
                np.linalg.solve(self.inertia, J.T @ (hold - C_T) - friction),
                np.hstack([zero, zero, zero, one]),
                np.linalg.solve(self.M, C_T - arm),
            ]
        )
        B_T = np.vstack([zero, np.linalg.solve(self.inertia, J.T), zero, zero])
        return A_T, B_T, C_T, zero

    def response(self, frequency_Hz: Floats) -> Complexes:
        """T_model = C_T (s 1 - A_T)^-1 B_T + D_T at s = j w, shape (n_f, 2, 2), N/N."""
        A_T, B_T, C_T, D_T = self.state_space()
        s = 2j * np.pi * frequency_Hz[:, np.newaxis, np.newaxis]
        return np.asarray(
            C_T @ np.linalg.solve(s * np.eye(8) - A_T, np.broadcast_to(B_T, (s.size, 8, 2))) + D_T
        )


def modified_perturbation(
    F_old: Floats, fs: float, contact: Contact, *, max_gain: float = 10.0, upper_Hz: float = 20.0
) -> Floats:
    """F_delta,new = T_model^-1 F_delta,old ([P] eq. 4): commanded, it delivers F_old to the arm.

    Near the load's own resonance T_model is almost singular, and its inverse would ask for any force; the
    gain is therefore limited. Components above `upper_Hz` hold no perturbation and are left out, because
    T_model^-1 grows with frequency.

    Args:
        F_old: perturbation meant for the arm (N), shape (N, 2).
        fs: sampling rate, Hz.
        contact: the linear model; it holds for one test location.
        max_gain: largest singular value of T_model^-1 that is applied; `inf` for none.
        upper_Hz: end of the band.

    Returns:
        F_new (N), shape (N, 2). Check its peak against what the robot may do to the subject.
    """
    # Silence behind the signal, so that the inverse's ringing does not come round to the beginning.
    n_fft = 2 ** int(np.ceil(np.log2(len(F_old) + SILENCE_AFTER_S * fs)))
    frequency = np.asarray(np.fft.rfftfreq(n_fft, 1.0 / fs), dtype=np.float64)
    band = (frequency > 0) & (frequency <= upper_Hz)
    T: Any = contact.response(frequency[band])
    left, gain, right = np.linalg.svd(T)
    # T = L g R^H, so T^-1 = R g^-1 L^H with 1/g limited.
    inverse_gain = np.minimum(1.0 / np.maximum(gain, np.finfo(float).tiny), max_gain)
    right_h, left_h = np.conj(np.swapaxes(right, 1, 2)), np.conj(np.swapaxes(left, 1, 2))
    T_inverse = right_h @ (inverse_gain[:, :, np.newaxis] * left_h)
    spectrum = np.fft.rfft(F_old, n_fft, axis=0)
    modified = np.zeros_like(spectrum)
    modified[band] = np.einsum("fij,fj->fi", T_inverse, spectrum[band])
    return np.asarray(np.fft.irfft(modified, n_fft, axis=0)[: len(F_old)])
