"""Identification in the time domain: robot from free trials, loads by virtual and by physical sensor."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.combinations import combinations, needs_unseen
from impid_host.impedance.estimators.estimated import Estimated
from impid_host.impedance.linear import Estimate, Stretch, enough_rows, fit_linear
from impid_host.impedance.loads import LoadModel
from impid_host.impedance.matrices import Quantity, load_matrices
from impid_host.impedance.reliability import by_angles, what_noise_hides
from impid_host.impedance.resting import moving_joints
from impid_host.impedance.rows import Equation, Series, Split, finish, series, stretches
from impid_host.impedance.virtual_sensor import beyond_force, through_jacobian
from impid_host.robot.terms import RobotStructure
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import Chain

Method = Literal["virtual sensor", "physical sensor"]


@dataclass(frozen=True, slots=True)
class RobotParameters:
    """What the virtual sensor needs to know of the robot.

    Attributes:
        structure: the model and its optional terms.
        value: (p,); covariance: (p, p), zero where it is not known.
        origin: "free trials"; "force sensor": under load, the sensor's force taken off; "saved model";
            "prior"; "none" for a torque sensor that carries nothing but the load;
            "unknown" where neither free trials nor a prior tell: values are not numbers, and Method 2 is
            all there is.
        unseen: directions in parameter space that the free trials leave open, (p, k), or None.
    """

    structure: RobotStructure
    value: Floats
    covariance: Floats
    origin: Literal["free trials", "force sensor", "saved model", "prior", "none", "unknown"]
    unseen: Floats | None = None


@dataclass(frozen=True, slots=True)
class RobotFit:
    """The robot identified from free trials.

    Attributes:
        vaf: per joint of `joints` on the held-out rows, %, averaged over trials; rms: likewise, N m (N).
        held_out: False when nothing was held out, and vaf and rms are those of the fitted rows.
        sources: where each trial's accelerations came from.
        joints: whose torque the fit explains, from 0; resting: those that rest in every trial.
        estimated: by which estimator, and why; None: by least squares, which nobody questioned.
    """

    parameters: RobotParameters
    estimate: Estimate
    vaf: Floats
    rms: Floats
    held_out: bool
    series: tuple[Series, ...]
    sources: tuple[str, ...]
    joints: tuple[int, ...]
    resting: tuple[int, ...] = ()
    estimated: Estimated | None = None


@dataclass(frozen=True, slots=True)
class LoadFit:
    """One load identified by one method.

    Attributes:
        M, B, K: (d, d), the handle taken off M where it moves with the load; None where the model has none.
        x0: equilibrium, (d,), m (rad); its interval by the delta method.
        robot_origin: where the robot's parameters came from, for Method 1; None for Method 2.
        beyond_force_percent: of the external torque's rms, what no force at the end-effector makes (moments
            there, pushes at links); None where joints are as many as axes, and for Method 2.
        vaf: per axis on the held-out rows, %, averaged over trials; rms: likewise, N.
        held_out: False when nothing was held out, and vaf and rms are those of the fitted rows.
        sources: where each trial's accelerations came from.
        estimated: by which estimator, and why; None: by least squares, which nobody questioned.
    """

    load: str
    model: LoadModel
    method: Method
    estimate: Estimate
    M: Quantity
    B: Quantity | None
    K: Quantity
    x0: Quantity
    vaf: Floats
    rms: Floats
    held_out: bool
    series: tuple[Series, ...]
    sources: tuple[str, ...]
    robot_origin: str | None = None
    beyond_force_percent: float | None = None
    estimated: Estimated | None = None


def robot_equation(
    trial: AlignedTrial, structure: RobotStructure, chain: Chain, joints: Sequence[int] | None = None
) -> Equation:
    """tau = Y @ parameters along a free trial, finished; of all joints, or of those that are asked for."""
    Y, tau = structure.regressor(trial.theta, trial.omega, trial.theta_dd, 1 / trial.rate_hz), trial.tau
    if joints is not None and len(joints) < tau.shape[1]:
        Y, tau = Y[:, list(joints)], tau[:, list(joints)]
    return Equation(trial, finish(chain, Y, trial.rate_hz), finish(chain, tau, trial.rate_hz))


def virtual_equation(trial: AlignedTrial, robot: RobotParameters, load: LoadModel, chain: Chain) -> Equation:
    """-F_ext = A @ parameters, F_ext by the virtual sensor; nuisance: its slope in the robot's parameters."""
    Y = robot.structure.regressor(trial.theta, trial.omega, trial.theta_dd, 1 / trial.rate_hz)
    model = robot.structure.model
    slope = finish(chain, through_jacobian(model, trial.theta, Y), trial.rate_hz)
    torque_part = finish(chain, through_jacobian(model, trial.theta, trial.tau), trial.rate_hz)
    A = finish(chain, load.regressor(trial.x, trial.v, trial.a), trial.rate_hz)
    return Equation(trial, A, torque_part - slope @ robot.value, -slope)


def physical_equation(
    trial: AlignedTrial, load: LoadModel, chain: Chain, A: Floats | None = None
) -> Equation:
    """-F_ext = A @ parameters with F_ext by the physical sensor.

    Args:
        A: finished, where the virtual sensor's equation has it already.

    Raises:
        UndeterminedError: the trial's log has no fx, fy.
    """
    if trial.force is None:
        raise UndeterminedError(f"trial {trial.name}: no fx, fy in robot.csv, so Method 2 has nothing to fit")
    if A is None:
        A = finish(chain, load.regressor(trial.x, trial.v, trial.a), trial.rate_hz)
    return Equation(trial, A, -finish(chain, trial.force, trial.rate_hz))


def identify_robot(
    trials: Sequence[AlignedTrial],
    structure: RobotStructure,
    chain: Chain,
    split: Split,
    instruments: Sequence[AlignedTrial] | None = None,
    known: Estimate | None = None,
) -> RobotFit:
    """Robot parameters by linear least squares over all free trials, [D] Appendix.

    With `instruments`, the same trials with their motion as something else tells it, they multiply the rows
    from the left instead (`linear`); `known` is the estimate, where another regression has made it.

    Where the trials leave parameters open, the estimate holds the combinations that they do determine.
    A joint that rests counts as still: its own friction and inertia stay open, and with dry friction in the
    model, which carries a part of it, so does its torque.

    Raises:
        UndeterminedError: the trials do not determine the parameters.
    """
    judged, moving, quiet = _explained(trials, structure, chain)
    equations, rows = _robot_rows(quiet, structure, chain, split, judged)
    if instruments is not None:
        still = moving_joints(instruments, structure.model.prismatic, chain)[1]
        equations = _beside(equations, [robot_equation(one, structure, chain, judged) for one in still])
        rows = _fit_rows(equations, chain, split)
    twins = _twins(quiet, lambda trial: robot_equation(trial, structure, chain, judged), chain, split)
    names, units = structure.parameter_names, structure.parameter_units
    unseen = None
    value, covariance = np.zeros(len(names)), np.zeros((len(names), len(names)))
    with _named("robot", trials):
        part = what_noise_hides(rows, twins, names)
        try:
            if part is None:
                estimate = known or fit_linear(rows, names, units, ar_order=chain.ar_order)
                value, covariance = estimate.value, estimate.covariance
        except UndeterminedError:
            if not enough_rows(rows, len(names)):
                raise
            part = combinations(rows, names)
            if part.unseen.shape[1] == 0:
                raise
        if part is not None:
            kept, unseen = list(part.kept), part.unseen
            own = tuple(units[k] for k in kept)
            cut = [part.cut(stretch) for stretch in rows]
            estimate = fit_linear(cut, part.labels, own, ar_order=chain.ar_order)
            value[kept], covariance[np.ix_(kept, kept)] = estimate.value, estimate.covariance
    shown = _series(equations, value, chain, split)
    parameters = RobotParameters(structure, value, covariance, "free trials", unseen)
    return RobotFit(
        parameters=parameters,
        estimate=estimate,
        vaf=np.mean([part.vaf() for part in shown], axis=0),
        rms=np.sqrt(np.mean([part.rms() ** 2 for part in shown], axis=0)),
        held_out=split.validation_s > 0,
        series=shown,
        sources=tuple(trial.source for trial in trials),
        joints=judged,
        resting=tuple(sorted(set(range(structure.model.joints)) - set(moving))),
    )


def robot_rows(
    trials: Sequence[AlignedTrial], structure: RobotStructure, chain: Chain, split: Split
) -> tuple[list[Equation], list[Stretch]]:
    """The equations of free trials, joints that rest taken as still, and the rows of them that are fitted."""
    judged, _, quiet = _explained(trials, structure, chain)
    return _robot_rows(quiet, structure, chain, split, judged)


def _robot_rows(
    quiet: Sequence[AlignedTrial],
    structure: RobotStructure,
    chain: Chain,
    split: Split,
    judged: tuple[int, ...],
) -> tuple[list[Equation], list[Stretch]]:
    equations = [robot_equation(trial, structure, chain, judged) for trial in quiet]
    return equations, _fit_rows(equations, chain, split)


def _explained(
    trials: Sequence[AlignedTrial], structure: RobotStructure, chain: Chain
) -> tuple[tuple[int, ...], tuple[int, ...], list[AlignedTrial]]:
    """Joints whose torque is explained, joints that move, and the trials with the others still."""
    moving, quiet = moving_joints(trials, structure.model.prismatic, chain)
    return (moving if structure.holds else tuple(range(structure.model.joints))), moving, quiet


def identify_load(
    trials: Sequence[AlignedTrial],
    load: LoadModel,
    chain: Chain,
    split: Split,
    *,
    robot: RobotParameters | None,
    handle_mass_kg: float,
    instruments: Sequence[AlignedTrial] | None = None,
    known: Estimate | None = None,
) -> LoadFit:
    """One load over all its trials: Method 1 with `robot`, Method 2 (physical sensor) when `robot` is None.

    Args:
        instruments: as in `identify_robot`; known: the estimate, where another regression has made it.

    Raises:
        UndeterminedError: the trials do not determine the parameters, or have no forces for Method 2.
    """
    equations, rows = load_rows(trials, load, chain, split, robot)
    if instruments is not None:
        equations = _beside(equations, [load_equation(one, load, chain) for one in instruments])
        rows = _fit_rows(equations, chain, split)
    with _named(f"load {trials[0].load}", trials):
        if what_noise_hides(rows, load_twins(trials, load, chain, split), load.parameter_names) is not None:
            raise UndeterminedError(
                "the motion along some axis does not rise above the accelerometer's noise"
            )
        estimate = known or fit_linear(
            rows,
            load.parameter_names,
            load.parameter_units,
            ar_order=chain.ar_order,
            nuisance_covariance=None if robot is None else robot.covariance,
        )
    shown = _series(equations, estimate.value, chain, split)
    matrices = load_matrices(load, estimate, handle_mass_kg)
    return LoadFit(
        load=trials[0].load,
        model=load,
        method=method_of(load, robot),
        estimate=estimate,
        M=matrices.M,
        B=matrices.B,
        K=matrices.K,
        x0=matrices.x0,
        vaf=np.mean([part.vaf() for part in shown], axis=0),
        rms=np.sqrt(np.mean([part.rms() ** 2 for part in shown], axis=0)),
        held_out=split.validation_s > 0,
        series=shown,
        sources=tuple(trial.source for trial in trials),
        robot_origin=None if robot is None else robot.origin,
        beyond_force_percent=None if robot is None else _beyond_force(trials, robot, chain),
    )


def _beyond_force(trials: Sequence[AlignedTrial], robot: RobotParameters, chain: Chain) -> float | None:
    model = robot.structure.model
    if model.joints == len(model.task_axes):
        return None
    left, whole = 0.0, 0.0
    for trial in trials:
        Y = robot.structure.regressor(trial.theta, trial.omega, trial.theta_dd, 1 / trial.rate_hz)
        torque = finish(chain, Y @ robot.value - trial.tau, trial.rate_hz)
        rest = beyond_force(model, trial.theta, torque)
        left += float(np.sum(rest[trial.valid] ** 2))
        whole += float(np.sum(torque[trial.valid] ** 2))
    return 100 * float(np.sqrt(left / max(whole, 1e-300)))


def load_rows(
    trials: Sequence[AlignedTrial], load: LoadModel, chain: Chain, split: Split, robot: RobotParameters | None
) -> tuple[list[Equation], list[Stretch]]:
    """A load's equations, and the rows of them that are fitted; arguments and errors as `identify_load`."""
    if robot is None:
        equations = [physical_equation(trial, load, chain) for trial in trials]
    else:
        equations = [virtual_equation(trial, robot, load, chain) for trial in trials]
        _require_seen(equations, robot, trials[0].load)
    return equations, _fit_rows(equations, chain, split)


def load_twins(trials: Sequence[AlignedTrial], load: LoadModel, chain: Chain, split: Split) -> list[Stretch]:
    """The rows of `load_rows` by the angles, where the accelerometer was used in every trial."""
    return _twins(trials, lambda trial: load_equation(trial, load, chain), chain, split)


def load_equation(trial: AlignedTrial, load: LoadModel, chain: Chain) -> Equation:
    """A load's regressor along a trial, finished, with no force beside it."""
    A = finish(chain, load.regressor(trial.x, trial.v, trial.a), trial.rate_hz)
    return Equation(trial, A, np.zeros(A.shape[:2]))


def _beside(equations: Sequence[Equation], others: Sequence[Equation]) -> list[Equation]:
    """The equations with the designs of `others` as their instruments."""
    return [replace(one, instruments=other.design) for one, other in zip(equations, others, strict=True)]


def _twins(
    trials: Sequence[AlignedTrial],
    equation: Callable[[AlignedTrial], Equation],
    chain: Chain,
    split: Split,
) -> list[Stretch]:
    if any(trial.source != "accelerometer" for trial in trials):
        return []
    return _fit_rows([equation(by_angles(trial)) for trial in trials], chain, split)


def method_of(load: LoadModel, robot: RobotParameters | None) -> Method:
    """Method 1 needs a robot; a rotary load's torque is measured at the load."""
    return "physical sensor" if robot is None or load.rotary else "virtual sensor"


def _require_seen(equations: Sequence[Equation], robot: RobotParameters, load: str) -> None:
    """The load's trials may ask only for what the free trials showed of the robot."""
    for equation in equations:
        slope = equation.nuisance
        if robot.unseen is not None and slope is not None and needs_unseen(slope, robot.unseen):
            names = robot.structure.parameter_names
            open_rows = np.any(robot.unseen != 0, axis=1)
            hidden = ", ".join(name for name, is_open in zip(names, open_rows, strict=True) if is_open)
            check = (
                " and check that the accelerometer follows the motion" if _by_accelerometer(equations) else ""
            )
            raise UndeterminedError(
                f"load {load}: its trials need robot parameters that the free trials leave open ({hidden}); "
                f"record a free trial that moves every joint{check}"
            )


def _by_accelerometer(equations: Sequence[Equation]) -> bool:
    return any(equation.trial.source == "accelerometer" for equation in equations)


@contextmanager
def _named(what: str, trials: Sequence[AlignedTrial]) -> Iterator[None]:
    """Errors of the regression say whose it was."""
    try:
        yield
    except UndeterminedError as error:
        names = ", ".join(trial.name for trial in trials)
        raise UndeterminedError(f"{what} (from {names}): {error}") from error


def _fit_rows(equations: Sequence[Equation], chain: Chain, split: Split) -> list[Stretch]:
    rows = [
        stretch
        for equation in equations
        for stretch in stretches(equation, split.masks(equation.trial, chain)[0], chain)
    ]
    if not rows:
        names = ", ".join(equation.trial.name for equation in equations)
        raise UndeterminedError(
            f"nothing of {names} is left between gaps and filter edges; record longer trials"
        )
    return rows


def _series(equations: Sequence[Equation], value: Floats, chain: Chain, split: Split) -> tuple[Series, ...]:
    return tuple(series(equation, value, split.masks(equation.trial, chain)[1]) for equation in equations)
