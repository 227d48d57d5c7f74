"""The gate of physics: what no robot, arm or spring can have, judged on final numbers with their intervals.

A value is refused only where its whole 95 % interval lies where nothing can be.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from impid_host.checks.check import Check, Checks
from impid_host.checks.physics import HEAVIEST_KG, STIFFEST_N_M
from impid_host.impedance.matrices import Quantity
from impid_host.robot.model import RobotModel
from impid_host.robot.terms import RobotStructure
from impid_host.signals.arrays import Floats

_LOOK = "run `impid-host check STUDY`: it tries the commonest mistakes"
_SPOTS = 60


@dataclass(frozen=True, slots=True)
class LoadNumbers:
    """One load's result.

    Attributes:
        name: for `where`, "spring_K1_M1" or "spring_K1_M1 (Method 2)".
        kind: mass-spring or arm.
        M, B, K: (d, d) with intervals (d, d, 2); None where the model has none.
        rotary: about an axis, where sizes in kg and N/m mean nothing.
    """

    name: str
    kind: Literal["mass-spring", "arm"]
    M: Quantity | None
    B: Quantity | None
    K: Quantity | None
    rotary: bool = False


@dataclass(frozen=True, slots=True)
class Bounded:
    """A reported parameter of an effect and what its catalogue row allows."""

    name: str
    where: str
    value: float
    ci95: tuple[float, float]
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class RobotNumbers:
    """A robot's result: value (k,), covariance (k, k) of the parameters that the structure calls by `names`.

    `theta`, (N, n), are angles that it visited: inertia must be positive definite there. Where not all
    parameters were told, none but friction and the like are judged.
    """

    structure: RobotStructure
    names: Sequence[str]
    value: Floats
    covariance: Floats
    theta: Floats


def gate(
    *,
    robot: RobotNumbers | None = None,
    loads: Sequence[LoadNumbers] = (),
    parameters: Iterable[Bounded] = (),
) -> Checks:
    """Judge one result, be it of `fit`, of a saved model, of a stage of `diagnose`, or of spectra.

    Args:
        robot: None where it was not identified.
        parameters: of effects, against the bounds that their catalogue declares.
    """
    entries: list[Check] = []
    if robot is not None:
        entries += _robot(robot)
    for load in loads:
        entries += _load(load)
    entries += [_beyond(one) for one in parameters if one.ci95[1] < one.low or one.ci95[0] > one.high]
    return Checks.of(entries)


def _robot(robot: RobotNumbers) -> Iterator[Check]:
    structure, sd = robot.structure, np.sqrt(np.maximum(np.diag(robot.covariance), 0.0))
    spots = robot.theta[:: max(1, len(robot.theta) // _SPOTS)]
    if tuple(robot.names) == structure.parameter_names and len(spots):
        p = len(structure.model.parameter_names)
        yield from _inertia(structure.model, robot.value[:p], robot.covariance[:p, :p], spots)
    for name, value, half in zip(robot.names, robot.value, 1.96 * sd, strict=True):
        place = structure.parameter_names.index(name)
        unit = structure.parameter_units[place]
        if structure.nonnegative[place] and value + half < 0:
            meaning = "viscous friction " if unit in ("N*m*s/rad", "N*s/m") else ""
            said = f"{meaning}{name} comes out at {value:.3g} +- {half:.2g} {unit}; none is negative"
            yield _impossible(_joint_of(place, structure), said, {name: value})


def _inertia(model: RobotModel, alpha: Floats, covariance: Floats, spots: Floats) -> Iterator[Check]:
    inertia = model.inertia(spots, alpha)
    values, vectors = np.linalg.eigh(inertia)
    # I(theta) is linear in alpha: d eigenvalue / d alpha_k = v^T I(theta; e_k) v.
    slope = np.stack(
        [
            np.einsum("ki,kij,kj->k", vectors[:, :, 0], model.inertia(spots, unit), vectors[:, :, 0])
            for unit in np.eye(len(alpha))
        ],
        axis=1,
    )
    half = 1.96 * np.sqrt(np.maximum(np.einsum("kp,pq,kq->k", slope, covariance, slope), 0.0))
    worst = int(np.argmin(values[:, 0] + half))
    if values[worst, 0] + half[worst] < 0:
        diagonal = np.diag(inertia[worst])
        joints = [k for k in range(model.joints) if diagonal[k] < 0] or list(range(model.joints))
        where = "+".join(f"joint{k + 1}" for k in joints)
        said = (
            f"the robot's inertia about joint {joints[0] + 1} comes out at {diagonal[joints[0]]:.3g}"
            if diagonal[joints[0]] < 0
            else "the robot's inertia matrix is not positive definite where it moved: "
            f"{values[worst, 0]:.3g} along one direction"
        )
        yield _impossible(where, said, {"inertia": inertia[worst], "eigenvalue": values[worst, 0]})
    if model.joints == len(model.task_axes):
        reach = np.maximum(np.sum(model.jacobian(spots) ** 2, axis=1), 1e-12)
        heavy = float(np.median(np.einsum("kii->ki", inertia) / reach, axis=0).max())
        if heavy > HEAVIEST_KG and "m^2" in model.parameter_units[0]:
            said = f"the robot weighs like {heavy:.3g} kg at its end: a unit must be wrong"
            yield _impossible("", said, {"mass_kg": heavy})


def _load(load: LoadNumbers) -> Iterator[Check]:
    if load.M is not None:
        yield from _not_negative(load, load.M, "mass" if not load.rotary else "inertia")
        heaviest = float(np.max(load.M.value))
        if not load.rotary and heaviest > HEAVIEST_KG:
            said = f"{load.name} weighs {heaviest:.3g} kg: a unit must be wrong"
            yield _impossible(load.name, said, {"M": load.M.value})
    if load.B is not None:
        yield from _not_negative(load, load.B, "damping")
    if load.K is not None:
        if load.kind == "mass-spring":
            yield from _not_negative(load, load.K, "stiffness")
        if not load.rotary and float(np.max(np.abs(load.K.value))) > STIFFEST_N_M:
            said = f"{load.name} has {np.max(np.abs(load.K.value)):.3g} N/m: a unit must be wrong"
            yield _impossible(load.name, said, {"K": load.K.value})


def _not_negative(load: LoadNumbers, quantity: Quantity, name: str) -> Iterator[Check]:
    """Impossible where the matrix is negative along some direction beyond its interval."""
    value = 0.5 * (quantity.value + quantity.value.T)
    if not np.isfinite(value).all():
        return
    half = 0.5 * (quantity.ci95[..., 1] - quantity.ci95[..., 0])
    values, vectors = np.linalg.eigh(value)
    along = np.outer(vectors[:, 0], vectors[:, 0])
    # Entries of one matrix are hardly correlated; where they are, an entry's own interval still counts.
    reach = float(np.sqrt(np.sum((along * half) ** 2)))
    if values[0] + reach < 0:
        unit = quantity.unit
        said = f"{load.name} has a {name} of {values[0]:.4g} +- {reach:.2g} {unit} along one direction"
        yield _impossible(load.name, said, {name: quantity.value})


def _impossible(where: str, said: str, evidence: dict[str, object]) -> Check:
    return Check("result.impossible", where, "impossible", said, evidence, _LOOK)


def _joint_of(place: int, structure: RobotStructure) -> str:
    """The last joint that a parameter moves."""
    state = np.linspace(0.3, 0.9, structure.model.joints)[None, :]
    column = structure.regressor(state, state, state)[0, :, place]
    return f"joint{int(np.flatnonzero(column)[-1]) + 1}"


def _beyond(one: Bounded) -> Check:
    return _impossible(
        one.where,
        f"{one.name} comes out at {one.value:.4g}, and cannot be outside {one.low:.4g} to {one.high:.4g}",
        {one.name: one.value},
    )
