"""Identification in the time domain: robot from free trials, loads by virtual and by physical sensor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import stats

from impid_host.errors import UndeterminedError
from impid_host.impedance.linear import Estimate, Stretch, fit_linear
from impid_host.impedance.loads import LoadModel
from impid_host.impedance.rows import Equation, Series, Split, finish, series, stretches
from impid_host.impedance.virtual_sensor import through_jacobian
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
        origin: "free trials" or "prior".
    """

    structure: RobotStructure
    value: Floats
    covariance: Floats
    origin: Literal["free trials", "prior"]


@dataclass(frozen=True, slots=True)
class RobotFit:
    """The robot identified from free trials.

    Attributes:
        vaf: per joint on the held-out rows, %, averaged over trials; rms: likewise, N m (N).
        held_out: False when nothing was held out, and vaf and rms are those of the fitted rows.
        sources: where each trial's accelerations came from.
    """

    parameters: RobotParameters
    estimate: Estimate
    vaf: Floats
    rms: Floats
    held_out: bool
    series: tuple[Series, ...]
    sources: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Quantity:
    """A vector or matrix with its 95 % interval: `ci95` has one more axis (low, high) than `value`."""

    value: Floats
    ci95: Floats
    unit: str


@dataclass(frozen=True, slots=True)
class LoadFit:
    """One load identified by one method.

    Attributes:
        M, B, K: (2, 2), the handle taken off M where it moves with the load; None where the model has none.
        x0: equilibrium, (2,), m; its interval by the delta method.
        vaf: per axis on the held-out rows, %, averaged over trials; rms: likewise, N.
        held_out: False when nothing was held out, and vaf and rms are those of the fitted rows.
        sources: where each trial's accelerations came from.
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


def robot_equation(trial: AlignedTrial, structure: RobotStructure, chain: Chain) -> Equation:
    """tau = Y @ parameters along a free trial, finished."""
    Y = structure.regressor(trial.theta, trial.omega, trial.theta_dd)
    return Equation(trial, finish(chain, Y, trial.rate_hz), finish(chain, trial.tau, trial.rate_hz))


def virtual_equation(trial: AlignedTrial, robot: RobotParameters, load: LoadModel, chain: Chain) -> Equation:
    """-F_ext = A @ parameters, F_ext by the virtual sensor; nuisance: its slope in the robot's parameters."""
    Y = robot.structure.regressor(trial.theta, trial.omega, trial.theta_dd)
    model = robot.structure.model
    slope = finish(chain, through_jacobian(model, trial.theta, Y), trial.rate_hz)
    torque_part = finish(chain, through_jacobian(model, trial.theta, trial.tau), trial.rate_hz)
    A = finish(chain, load.regressor(trial.x, trial.v, trial.a), trial.rate_hz)
    return Equation(trial, A, torque_part - slope @ robot.value, -slope)


def physical_equation(trial: AlignedTrial, load: LoadModel, chain: Chain) -> Equation:
    """-F_ext = A @ parameters with F_ext by the physical sensor.

    Raises:
        UndeterminedError: the trial's log has no fx, fy.
    """
    if trial.force is None:
        raise UndeterminedError(f"trial {trial.name}: no fx, fy in robot.csv, so Method 2 has nothing to fit")
    A = finish(chain, load.regressor(trial.x, trial.v, trial.a), trial.rate_hz)
    return Equation(trial, A, -finish(chain, trial.force, trial.rate_hz))


def identify_robot(
    trials: Sequence[AlignedTrial], structure: RobotStructure, chain: Chain, split: Split
) -> RobotFit:
    """Robot parameters by linear least squares over all free trials, [D] Appendix.

    Raises:
        UndeterminedError: the trials do not determine the parameters.
    """
    equations = [robot_equation(trial, structure, chain) for trial in trials]
    rows = _fit_rows(equations, chain, split)
    names, units = structure.parameter_names, structure.parameter_units
    estimate = fit_linear(rows, names, units, ar_order=chain.ar_order)
    shown = _series(equations, estimate.value, chain, split)
    parameters = RobotParameters(structure, estimate.value, estimate.covariance, "free trials")
    return RobotFit(
        parameters=parameters,
        estimate=estimate,
        vaf=np.mean([part.vaf() for part in shown], axis=0),
        rms=np.sqrt(np.mean([part.rms() ** 2 for part in shown], axis=0)),
        held_out=split.validation_s > 0,
        series=shown,
        sources=tuple(trial.source for trial in trials),
    )


def identify_load(
    trials: Sequence[AlignedTrial],
    load: LoadModel,
    chain: Chain,
    split: Split,
    *,
    robot: RobotParameters | None,
    handle_mass_kg: float,
) -> LoadFit:
    """One load over all its trials: Method 1 with `robot`, Method 2 (physical sensor) when `robot` is None.

    Raises:
        UndeterminedError: the trials do not determine the parameters, or have no forces for Method 2.
    """
    if robot is None:
        equations = [physical_equation(trial, load, chain) for trial in trials]
    else:
        equations = [virtual_equation(trial, robot, load, chain) for trial in trials]
    estimate = fit_linear(
        _fit_rows(equations, chain, split),
        load.parameter_names,
        load.parameter_units,
        ar_order=chain.ar_order,
        nuisance_covariance=None if robot is None else robot.covariance,
    )
    shown = _series(equations, estimate.value, chain, split)
    handle = handle_mass_kg if load.carries_handle else 0.0
    M = _matrix(load, estimate, "a", "kg")
    has_damping = any(column.signal == "v" for column in load.columns)
    return LoadFit(
        load=trials[0].load,
        model=load,
        method="physical sensor" if robot is None else "virtual sensor",
        estimate=estimate,
        M=Quantity(M.value - handle * np.eye(2), M.ci95 - handle * np.eye(2)[:, :, None], M.unit),
        B=_matrix(load, estimate, "v", "N*s/m") if has_damping else None,
        K=_matrix(load, estimate, "x", "N/m"),
        x0=equilibrium(load, estimate),
        vaf=np.mean([part.vaf() for part in shown], axis=0),
        rms=np.sqrt(np.mean([part.rms() ** 2 for part in shown], axis=0)),
        held_out=split.validation_s > 0,
        series=shown,
        sources=tuple(trial.source for trial in trials),
    )


def equilibrium(load: LoadModel, estimate: Estimate) -> Quantity:
    """x0 = K^-1 (K x0) with its interval by the delta method, m."""
    S = load.matrix_map("x")
    place = [load.parameter_names.index("cx"), load.parameter_names.index("cy")]
    K = (S @ estimate.value).reshape(2, 2)
    x0: Floats = np.linalg.solve(K, estimate.value[place]).astype(np.float64)
    # d x0 = K^-1 (d c - dK x0)
    slope: Floats = np.zeros((2, len(estimate.value)))
    slope[:, place] = np.eye(2)
    slope -= np.einsum("ijq,j->iq", S.reshape(2, 2, -1), x0)
    slope = np.linalg.solve(K, slope).astype(np.float64)
    variance = np.diag(slope @ estimate.covariance @ slope.T)
    half = stats.t.ppf(0.975, estimate.dof) * np.sqrt(variance)
    return Quantity(x0, np.stack([x0 - half, x0 + half], axis=1), "m")


def _matrix(load: LoadModel, estimate: Estimate, signal: Literal["a", "v", "x"], unit: str) -> Quantity:
    S = load.matrix_map(signal)
    value = S @ estimate.value
    half = stats.t.ppf(0.975, estimate.dof) * np.sqrt(np.diag(S @ estimate.covariance @ S.T))
    interval = np.stack([value - half, value + half], axis=1)
    return Quantity(value.reshape(2, 2), interval.reshape(2, 2, 2), unit)


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
