"""The virtual force sensor against a physical one: its error in newtons where both measured one load."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.identify import RobotFit, RobotParameters, identify_robot
from impid_host.impedance.rows import Split, finish
from impid_host.impedance.virtual_sensor import external_force, through_jacobian
from impid_host.robot.terms import RobotStructure
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.chain import Chain

STATICS = "torque alone, nothing fitted"
UNDER_LOAD = "robot fitted under this load, the sensor's force taken off"


@dataclass(frozen=True, slots=True)
class ForceError:
    """How far one virtual force is from the measured one, per axis, (d,), on the judged rows.

    Attributes:
        by: what the virtual force rests on.
        rms: of the difference, N; relative_percent: of the measured force's rms, its mean included.
        bias: mean difference, virtual less measured, N.
    """

    by: str
    rms: Floats
    relative_percent: Floats
    bias: Floats


@dataclass(frozen=True, slots=True)
class ForceComparison:
    """One load's virtual forces beside the sensor's.

    Attributes:
        signal_rms: of the measured force, N, (d,).
        held_out: judged on rows that took no part in any fit.
    """

    load: str
    axes: tuple[str, ...]
    trials: tuple[str, ...]
    signal_rms: Floats
    errors: tuple[ForceError, ...]
    held_out: bool


def own_torque(trial: AlignedTrial, structure: RobotStructure) -> AlignedTrial:
    """The trial with the sensor's force taken out of the torque: tau + J^T F_ext is the robot's own.

    Raises:
        UndeterminedError: the trial's log has no force.
    """
    if trial.force is None:
        raise UndeterminedError(
            f"trial {trial.name}: no fx, fy in robot.csv, so its load cannot be taken off"
        )
    J = structure.model.jacobian(trial.theta)
    return replace(trial, tau=trial.tau + np.einsum("kij,ki->kj", J, trial.force))


def robot_under_load(
    trials: Sequence[AlignedTrial], structure: RobotStructure, chain: Chain, split: Split
) -> RobotFit:
    """The robot from loaded trials whose force a sensor measured; errors as `identify_robot`."""
    found = identify_robot([own_torque(trial, structure) for trial in trials], structure, chain, split)
    return replace(found, parameters=replace(found.parameters, origin="force sensor"))


def compare_forces(
    trials: Sequence[AlignedTrial], robot: RobotParameters, chain: Chain, split: Split
) -> ForceComparison:
    """Virtual against physical force of one load's trials, all of which have forces along the task axes.

    Beside the force by the robot's parameters stands that of the torque alone, F = -J^-T tau; a robot that
    neither free trials nor a prior show is fitted under the load itself and judged on what is held out.

    Raises:
        UndeterminedError: fewer joints than axes.
    """
    structure = robot.structure
    rows = [split.masks(trial, chain)[1] for trial in trials]
    measured = [_finished(chain, trial, trial.force) for trial in trials if trial.force is not None]
    still = np.zeros(len(structure.parameter_names))
    virtual = {STATICS: [_virtual(trial, structure, still, chain) for trial in trials]}
    words, known = f"robot from {robot.origin}", robot
    if robot.origin == "unknown":
        words = UNDER_LOAD
        try:
            known = robot_under_load(trials, structure, chain, split).parameters
        except UndeterminedError:
            words = ""
    if words and robot.origin != "none":
        virtual[words] = [_virtual(trial, structure, known.value, chain) for trial in trials]
    true = _judged(measured, rows)
    signal = np.sqrt(np.mean(true**2, axis=0))
    errors = []
    for by, estimates in virtual.items():
        difference = _judged(estimates, rows) - true
        rms: Floats = np.sqrt(np.mean(difference**2, axis=0))
        errors.append(ForceError(by, rms, 100 * rms / np.maximum(signal, 1e-300), difference.mean(axis=0)))
    return ForceComparison(
        load=trials[0].load,
        axes=tuple(structure.model.task_axes),
        trials=tuple(trial.name for trial in trials),
        signal_rms=signal,
        errors=tuple(errors),
        held_out=split.validation_s > 0,
    )


@dataclass(frozen=True, slots=True)
class ForceSeries:
    """Force of the load on the robot along one trial, base frame, finished by the chain.

    Attributes:
        t: s since the trial's first common instant, (N,); valid: rows that neither a gap nor a filter's edge
            touches, (N,).
        virtual: by the virtual sensor, N, (N, d), None where the robot is unknown; sd: its standard deviation
            by the robot's parameters alone, N, (N, d).
        physical: by the physical sensor, N, (N, d), or None.
    """

    axes: tuple[str, ...]
    t: Floats
    valid: Mask
    virtual: Floats | None
    sd: Floats | None
    physical: Floats | None


def force_series(trial: AlignedTrial, robot: RobotParameters, chain: Chain) -> ForceSeries:
    """Both forces along a whole trial.

    Raises:
        UndeterminedError: fewer joints than axes.
    """
    structure = robot.structure
    virtual = sd = None
    if robot.origin != "unknown":
        virtual = _virtual(trial, structure, robot.value, chain)
        Y = structure.regressor(trial.theta, trial.omega, trial.theta_dd, 1 / trial.rate_hz)
        slope = _finished(chain, trial, through_jacobian(structure.model, trial.theta, Y))
        sd = np.sqrt(np.einsum("ndp,pq,ndq->nd", slope, robot.covariance, slope))
    physical = None if trial.force is None else _finished(chain, trial, trial.force)
    axes = tuple(structure.model.task_axes)
    return ForceSeries(axes, trial.elapsed, trial.valid, virtual, sd, physical)


def _virtual(trial: AlignedTrial, structure: RobotStructure, value: Floats, chain: Chain) -> Floats:
    if not value.any():
        return _finished(chain, trial, -through_jacobian(structure.model, trial.theta, trial.tau))
    Y = structure.regressor(trial.theta, trial.omega, trial.theta_dd, 1 / trial.rate_hz)
    return _finished(chain, trial, external_force(structure.model, trial.theta, Y, value, trial.tau))


def _finished(chain: Chain, trial: AlignedTrial, values: Floats) -> Floats:
    return finish(chain, values, trial.rate_hz)


def _judged(values: Sequence[Floats], rows: Sequence[np.ndarray]) -> Floats:
    return np.concatenate([part[kept] for part, kept in zip(values, rows, strict=True)])
