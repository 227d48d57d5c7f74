"""Terms that a user may add to a robot model by name (`fit --with NAME`): one row of the table each."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.robot.model import RobotModel
from impid_host.signals.arrays import Floats
from impid_host.signals.direction import sign_mean

JointColumn = Callable[[Floats, Floats, Floats, float], Floats]
"""Angles, speeds, accelerations (N, n) and the sample's length in s -> the column, (N, n)."""


@dataclass(frozen=True, slots=True)
class Term:
    """A torque added on each joint: `parameter * column(theta, omega, theta_dd, dt)`, (N, n) -> (N, n).

    `holds`: at rest it carries whatever it must, so that the torque of a joint that rests says nothing;
    `nonnegative`: nothing has a negative one.
    """

    name: str
    parameter: str
    unit: str
    column: JointColumn
    holds: bool = False
    nonnegative: bool = False


# Functions with a name: a fit that holds one of them can be sent to another process.
def _direction(_theta: Floats, omega: Floats, acc: Floats, dt: float) -> Floats:
    return sign_mean(omega, acc, dt)


def _constant(_theta: Floats, omega: Floats, _acc: Floats, _dt: float) -> Floats:
    return np.ones_like(omega)


def _signed_square(_theta: Floats, omega: Floats, _acc: Floats, _dt: float) -> Floats:
    return omega * np.abs(omega)


def _acceleration(_theta: Floats, _omega: Floats, acc: Floats, _dt: float) -> Floats:
    return acc


def _angle(theta: Floats, _omega: Floats, _acc: Floats, _dt: float) -> Floats:
    return theta


TERMS: dict[str, Term] = {
    term.name: term
    for term in (
        Term("friction.coulomb", "Fc", "N*m", _direction, True, True),
        Term("actuator.offset", "offset", "N*m", _constant),
        Term(
            "friction.quadratic",
            "Fq",
            "N*m*s^2/rad^2",
            _signed_square,
            nonnegative=True,
        ),
        Term("inertia.rotor", "Ia", "kg*m^2", _acceleration, nonnegative=True),
        Term("elastic.joint", "k", "N*m/rad", _angle, nonnegative=True),
    )
}


@dataclass(frozen=True, slots=True)
class RobotStructure:
    """A robot model and the optional terms beside it: what a regression of the torque is built from.

    Attributes:
        gravity: the links' weight stands beside a model that has none (`RobotModel.gravity_parameters`).
    """

    model: RobotModel
    terms: tuple[Term, ...] = ()
    gravity: bool = False

    @property
    def _weight(self) -> tuple[str, ...]:
        return self.model.gravity_parameters if self.gravity else ()

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """The model's parameters, gravity's where it stands beside them, then each term's, one per joint."""
        return (
            self.model.parameter_names
            + self._weight
            + tuple(
                f"{term.parameter}{joint + 1}" if self.model.joints > 1 else term.parameter
                for term in self.terms
                for joint in range(self.model.joints)
            )
        )

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units in the order of the names; on a prismatic axis N and m stand for N m and rad."""
        return (
            self.model.parameter_units
            + ("N*m",) * len(self._weight)
            + tuple(
                term.unit.replace("kg*m^2", "kg").replace("N*m", "N").replace("rad", "m")
                if slides
                else term.unit
                for term in self.terms
                for slides in self.model.prismatic
            )
        )

    @property
    def torque_units(self) -> tuple[str, ...]:
        """Unit of each joint's torque, n."""
        return tuple("N" if slides else "N*m" for slides in self.model.prismatic)

    @property
    def nonnegative(self) -> tuple[bool, ...]:
        """Which of the parameters cannot be negative, in the order of the names."""
        return (
            self.model.nonnegative
            + (False,) * len(self._weight)
            + tuple(term.nonnegative for term in self.terms for _ in range(self.model.joints))
        )

    @property
    def holds(self) -> bool:
        """True where dry friction may carry a part of the torque of a joint that rests."""
        return any(term.holds for term in self.terms)

    def regressor(self, theta: Floats, omega: Floats, theta_dd: Floats, dt: float = 0.0) -> Floats:
        """Y with tau = Y @ parameters in free motion: (N, n) three times -> (N, n, p).

        Args:
            dt: the sample's length, s, over which a reversal is averaged; 0: the sign at the instant.
        """
        blocks = [self.model.regressor(theta, omega, theta_dd)]
        if self.gravity:
            blocks.append(self.model.gravity_regressor(theta))
        for term in self.terms:
            column = term.column(theta, omega, theta_dd, dt)
            blocks.append(column[:, :, None] * np.eye(self.model.joints))
        return np.concatenate(blocks, axis=2)

    def dynamics(self, theta: Floats, omega: Floats, value: Floats) -> tuple[Floats, Floats]:
        """M (N, n, n) and rest (N, n) with tau = M theta'' + rest, in free motion.

        The regressor is linear in the acceleration: with one unit of it, less what is there without, it gives
        a column of M, optional terms included.

        Args:
            theta, omega: (N, n) each; value: parameters, (p,), or (N, p) for each row its own.
        """
        rows, n = theta.shape
        units = np.zeros((n + 1, rows, n))
        units[range(1, n + 1), :, range(n)] = 1.0
        places, speeds = (np.concatenate([part] * (n + 1)) for part in (theta, omega))
        Y = self.regressor(places, speeds, units.reshape(-1, n)).reshape(n + 1, rows, n, -1)
        torque = (Y @ value[..., None])[..., 0]
        return (torque[1:] - torque[0]).transpose(1, 2, 0), torque[0]


def robot_structure(model: RobotModel, names: tuple[str, ...] = ()) -> RobotStructure:
    """The model with the named optional terms.

    Raises:
        UndeterminedError: a name that is not in the table.
    """
    unknown = [name for name in names if name not in TERMS]
    if unknown:
        raise UndeterminedError(f"no term called {unknown[0]!r}; there are {', '.join(TERMS)}")
    return RobotStructure(model, tuple(TERMS[name] for name in names))
