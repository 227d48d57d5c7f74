"""An arm's endpoint impedance in its own joints: shoulder and elbow, from the limb lengths.

Source: Mussa-Ivaldi, Hogan and Bizzi 1985: R = J^T K J at the posture where the hand rests, where no force
acts and the change of J with posture adds nothing. M and B go over alike.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.identify import LoadFit
from impid_host.impedance.matrices import Quantity, mapped
from impid_host.signals.arrays import Floats


@dataclass(frozen=True, slots=True)
class Limb:
    """The subject's arm in the plane of measurement, in the robot's base frame.

    Attributes:
        upper_m, fore_m: shoulder to elbow, elbow to hand, m.
        shoulder_m: (x, y), m.
        side: seen from above (z up), flexing a right elbow turns the forearm counter-clockwise.
    """

    upper_m: float
    fore_m: float
    shoulder_m: tuple[float, float]
    side: str = "right"

    def posture(self, hand_m: Floats) -> Floats:
        """Shoulder angle and elbow flexion (relative), rad, (2,), that put the hand at `hand_m` (2,).

        Raises:
            UndeterminedError: the hand is out of reach.
        """
        reach = hand_m - np.array(self.shoulder_m)
        square = float(reach @ reach)
        cosine = (square - self.upper_m**2 - self.fore_m**2) / (2 * self.upper_m * self.fore_m)
        if abs(cosine) > 1:
            raise UndeterminedError(
                f"the hand is {np.sqrt(square):.3f} m from the shoulder, which limbs of {self.upper_m} and "
                f"{self.fore_m} m do not reach; check --limb and --shoulder"
            )
        elbow = np.arccos(cosine) * (1.0 if self.side == "right" else -1.0)
        shoulder = np.arctan2(reach[1], reach[0]) - np.arctan2(
            self.fore_m * np.sin(elbow), self.upper_m + self.fore_m * np.cos(elbow)
        )
        return np.array([shoulder, elbow])

    def jacobian(self, posture: Floats) -> Floats:
        """d hand / d (shoulder, elbow), m/rad, (2, 2)."""
        s, e = posture[0], posture[0] + posture[1]
        far = self.fore_m * np.array([-np.sin(e), np.cos(e)])
        near = self.upper_m * np.array([-np.sin(s), np.cos(s)])
        return np.stack([near + far, far], axis=1)


@dataclass(frozen=True, slots=True)
class JointImpedance:
    """Inertia (kg m^2), damping (N m s/rad) and stiffness (N m/rad) of shoulder and elbow, (2, 2).

    `posture` is the shoulder's angle from x and the elbow's flexion, rad, (2,).
    """

    load: str
    method: str
    posture: Floats
    inertia: Quantity
    damping: Quantity | None
    stiffness: Quantity


def joint_impedance(fit: LoadFit, limb: Limb, handle_mass_kg: float) -> JointImpedance:
    """Endpoint impedance through the limb's Jacobian at the equilibrium.

    Args:
        handle_mass_kg: as for the fit; the handle is no part of the arm.

    Raises:
        UndeterminedError: the load does not move in a plane, or the hand is out of reach.
    """
    load = fit.model
    if len(load.axes) != 2:
        raise UndeterminedError(f"load {fit.load}: joint-space impedance needs a hand that moves in a plane")
    posture = limb.posture(fit.x0.value)
    J = limb.jacobian(posture)
    both = np.kron(J.T, J.T)  # vec of J^T A J, row by row
    own = (handle_mass_kg if load.carries_handle else 0.0) * np.eye(2)

    def carried(signal: str, unit: str, taken_off: Floats) -> Quantity:
        slope = both @ load.matrix_map(signal)  # type: ignore[arg-type]
        value = slope @ fit.estimate.value - both @ taken_off.ravel()
        return mapped(fit.estimate, slope, value, unit, (2, 2))

    nothing = np.zeros((2, 2))
    return JointImpedance(
        fit.load,
        fit.method,
        posture,
        carried("a", "kg*m^2", own),
        carried("v", "N*m*s/rad", nothing) if load.has("v") else None,
        carried("x", "N*m/rad", nothing),
    )
