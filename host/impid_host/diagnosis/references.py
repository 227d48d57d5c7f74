"""What the study knows from elsewhere, against what it shows: the prior's robot, and weighed payloads.

A common factor on the torques, a mass that is always at the tip, a rotor's inertia that is always there: no
residual shows them, for they hide in the identified parameters. A reference shows that something is wrong,
and by which parameters are off, what it could be.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np
from scipy import stats

from impid_host.diagnosis.result import Number, Stage, Tie
from impid_host.effects.effect import joint_name
from impid_host.robot.model import RobotModel
from impid_host.signals.arrays import Floats

_P_VALUE = 1e-4
_EXACT = 0.002  # relative standard deviation of a reference, besides its rounding
_WARM = 0.05  # of viscous friction, which follows the temperature of the grease
_INERTIA = 0.01  # least difference that is told, of a main inertia
_VISCOUS = 0.10
_MASS = 0.02
_SHARE = 0.8  # of the difference (as chi-squared) that a candidate must explain
_ADDING = ("inertia.", "elastic.transmission")
_INSIDE = 1e-6  # part of an effect's torque that the model's parameters may fail to make
_RETURN = "a free trial with the robot as it was when the prior was measured, and one with faster motion"
_WEIGHED = "a load trial with a weighed payload (payload_kg)"
_SENSOR = "a free trial with a prior (in setup.toml) and a load trial with a force sensor"


@dataclass(frozen=True, slots=True)
class Reference:
    """What the comparison says: ties for `ambiguous`, words for the notes."""

    ties: tuple[Tie, ...] = ()
    notes: tuple[str, ...] = ()


def against_prior(prior: Sequence[float], model: RobotModel, alpha: Number) -> Reference:
    """The robot identified in free trials against the one of setup.toml.

    Args:
        prior: (p,), in the order of the model's parameters; alpha: (p,) with its covariance.
    """
    value, known = alpha.value, np.array(prior)
    if alpha.covariance is None or len(known) != len(value):
        return Reference()
    inertial = np.array([not unit.startswith("N") for unit in model.parameter_units])
    difference = value - known
    own = (np.where(inertial, _EXACT, _WARM) * known) ** 2 + [_rounding(one) ** 2 for one in prior]
    covariance = alpha.covariance + np.diag(own)
    if significance(difference[inertial], covariance[np.ix_(inertial, inertial)]) < _P_VALUE and np.any(
        np.abs(difference)[inertial] > _INERTIA * _main_sizes(known, model.parameter_units)[inertial]
    ):
        labels = explained_by(difference, covariance, signatures(model, value))
        words = _told("the robot's inertia", model, known, value, inertial)
        tie = Tie(labels, _WEIGHED if any(label.startswith("actuator") for label in labels) else _RETURN)
        return Reference((tie,) if labels else (), (words,))
    sd = np.sqrt(np.diag(covariance))
    worn = ~inertial & (np.abs(difference) > np.maximum(_VISCOUS * np.abs(known), 4.0 * sd))
    if np.any(worn):
        words = _told("viscous friction", model, known, value, worn)
        return Reference(notes=(f"{words}: wear or warmth, which no effect of the catalogue stands for",))
    return Reference()


def against_scales(
    weighed: Mapping[str, float], stage: Stage, joints: int, *, accelerometer: bool
) -> Reference:
    """The masses identified under mass-spring loads against their weights.

    Args:
        weighed: kg by load; stage: with the loads' matrices in it; joints: of the robot.
    """
    names = [name for name, mass in weighed.items() if mass > 0 and "M" in stage.loads.get(name, {})]
    if not names:
        return Reference()
    mass = np.array([weighed[name] for name in names])
    number = [stage.loads[name]["M"] for name in names]
    found = np.array([np.diag(one.value).mean() for one in number])
    half = np.array([(np.diag(one.ci95[..., 1]) - np.diag(one.ci95[..., 0])).mean() / 2 for one in number])
    covariance = np.diag((half / stats.norm.ppf(0.975)) ** 2 + (_EXACT * mass) ** 2)
    difference = found - mass
    if significance(difference, covariance) >= _P_VALUE or np.all(np.abs(difference) <= _MASS * mass):
        return Reference()
    factors = [gain_of_all(joints), *(["accel.scale@x+y"] if accelerometer else [])]
    effects = {**dict.fromkeys(factors, mass), "inertia.extra@tip": np.ones_like(mass)}
    labels = explained_by(difference, covariance, effects)
    told = ", ".join(
        f"{name} {own:.4g} kg for {true:.4g} kg" for name, own, true in zip(names, found, mass, strict=True)
    )
    words = f"the masses found are not those that were weighed: {told}"
    return Reference((Tie(labels, _SENSOR),) if labels else (), (words,))


def significance(difference: Floats, covariance: Floats) -> float:
    """p-value of a difference (k,) under its covariance (k, k), by chi-squared."""
    return float(stats.chi2.sf(difference @ np.linalg.pinv(covariance) @ difference, len(difference)))


def explained_by(difference: Floats, covariance: Floats, effects: Mapping[str, Floats]) -> tuple[str, ...]:
    """The labels of the effects, given by what one unit adds, (k,), that explain most of it; best first.

    An inertia that is there and was not before can only add.
    """
    W = np.linalg.pinv(covariance)
    whole = difference @ W @ difference
    shares = []
    for label, column in effects.items():
        along, norm = column @ W @ difference, column @ W @ column
        if label.startswith(_ADDING) and along <= 0:
            continue
        shares.append((along**2 / norm / whole, label))
    # Equal shares keep the order in which they were given.
    best = sorted(shares, key=lambda pair: -round(float(pair[0]), 9))
    return tuple(label for share, label in best if share >= _SHARE)


def signatures(model: RobotModel, alpha: Floats) -> dict[str, Floats]:
    """What effects that are always there add to the robot's parameters, (p,) each, by label.

    An effect whose torque the parameters cannot make leaves a residual, and is not one of these.
    """
    generator = np.random.default_rng(0)
    theta, omega, acc = generator.uniform(-2.0, 2.0, (3, 20 * len(alpha), model.joints))
    Y = model.regressor(theta, omega, acc)
    result = {}
    torques = {f"inertia.extra@{joint_name(j)}": acc * np.eye(model.joints)[j] for j in range(model.joints)}
    if len(model.task_axes) == 2:
        torques["inertia.extra@tip"] = _tip_mass(model, theta, omega, acc)
    flat = Y.reshape(-1, Y.shape[2])
    for label, torque in torques.items():
        value = np.linalg.lstsq(flat, torque.ravel(), rcond=1e-10)[0]
        if np.linalg.norm(torque.ravel() - flat @ value) < _INSIDE * np.linalg.norm(torque):
            result[label] = value
    result[gain_of_all(model.joints)] = alpha
    # Where the transmission is too stiff to be seen, the motor's inertia is all there is of it.
    for joint in map(joint_name, range(model.joints)):
        if f"inertia.extra@{joint}" in result:
            result[f"elastic.transmission@{joint}"] = result[f"inertia.extra@{joint}"]
    return result


def gain_of_all(joints: int) -> str:
    """The label of a common factor on all torques."""
    return f"actuator.gain@{'+'.join(joint_name(joint) for joint in range(joints))}"


def _tip_mass(model: RobotModel, theta: Floats, omega: Floats, acc: Floats) -> Floats:
    """Torque of 1 kg at the end-effector, (N, n): J^T (J theta'' + J' omega - g)."""
    J = model.jacobian(theta)
    a = np.einsum("kij,kj->ki", J, acc) + np.einsum("kij,kj->ki", model.jacobian_rate(theta, omega), omega)
    torque: Floats = np.einsum("kij,ki->kj", J, a - np.array(model.plane_gravity_m_s2))
    return torque


def _rounding(value: float) -> float:
    """Standard deviation of what was cut off behind the last digit that was written."""
    exponent = Decimal(repr(float(value))).as_tuple().exponent
    return 10.0 ** int(exponent) / 12**0.5


def _main_sizes(value: Floats, units: Sequence[str]) -> Floats:
    """What each parameter is compared with: its own size, but no less than half the largest of its unit."""
    return np.array(
        [
            max(abs(own), 0.5 * max(abs(v) for v, u in zip(value, units, strict=True) if u == unit))
            for own, unit in zip(value, units, strict=True)
        ]
    )


def _told(what: str, model: RobotModel, known: Floats, value: Floats, some: Floats) -> str:
    numbers = ", ".join(
        f"{name} {value[k]:.4g} for {known[k]:.4g} {model.parameter_units[k]}"
        for k, name in enumerate(model.parameter_names)
        if some[k]
    )
    return f"{what} is not the one of setup.toml (prior): {numbers}"
