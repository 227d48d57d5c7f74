"""Instruments: the motion of a trial as something tells it that has nothing to do with the noise in the rows.

Two sources. The simulated model: robot, and load where there is one, driven by what the controller was told
(the reference, or the commanded perturbation) under the controller that the record itself shows; its motion
follows from commands alone (IDIM-IV: Janot, Vandanjon and Gautier, IEEE Trans. Control Syst. Tech. 22, 2014).
And the angles, where accelerations come from an accelerometer: another sensor saw the same motion (a second
measurement; Fuller, Measurement Error Models, 1987, sec. 2.4); what an encoder itself errs stays.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.estimators.plant import Law, Machines, integrate
from impid_host.impedance.loads import LoadModel
from impid_host.impedance.reliability import by_angles
from impid_host.impedance.rows import finish
from impid_host.robot.terms import RobotStructure
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import Chain

Source = Literal["simulated model", "angles"]


@dataclass(frozen=True, slots=True)
class Model:
    """What is simulated: the robot's parameters (p,), and the load's (q,) where there is one."""

    structure: RobotStructure
    alpha: Floats
    load: LoadModel | None = None
    value: Floats | None = None


def commanded(trials: Sequence[AlignedTrial]) -> bool:
    """True where every trial says what its controller was told."""
    return all(trial.reference is not None or _push(trial) is not None for trial in trials)


def _push(trial: AlignedTrial) -> Floats | None:
    """The commanded perturbation along the robot's own axes; fdx, fdy are forces in a plane."""
    p = trial.perturbation
    return p if p is not None and p.shape[1] == trial.x.shape[1] else None


def by_accelerometer(trials: Sequence[AlignedTrial]) -> bool:
    """True where every trial's accelerations are an accelerometer's, so that the angles tell them again."""
    return all(trial.source == "accelerometer" for trial in trials)


def twins_by_angles(trials: Sequence[AlignedTrial]) -> list[AlignedTrial]:
    """The trials with their accelerations from the angles."""
    return [by_angles(trial) for trial in trials]


def twins_by_simulation(trials: Sequence[AlignedTrial], model: Model, chain: Chain) -> list[AlignedTrial]:
    """The trials with the motion of the simulated model.

    Raises:
        UndeterminedError: the simulated model runs away.
    """
    machines = Machines(
        model.structure, model.alpha[None], model.load, None if model.value is None else model.value[None]
    )
    laws = [controller(trial, model.structure, chain) for trial in trials]
    try:
        motions = integrate(machines, laws, [(trial.theta[:1], trial.omega[:1]) for trial in trials])
    except (UndeterminedError, np.linalg.LinAlgError) as error:
        names = ", ".join(trial.name for trial in trials)
        raise UndeterminedError(f"the model simulated under the controller of {names} runs away") from error
    out = []
    for trial, law, (theta, omega) in zip(trials, laws, motions, strict=True):
        tau = law.torque(model.structure.model, theta[0], omega[0])
        theta_dd = machines.at(0, len(tau)).accelerations(theta[0], omega[0], tau)
        out.append(moved(trial, theta[0], omega[0], theta_dd, model))
    return out


def moved(trial: AlignedTrial, theta: Floats, omega: Floats, theta_dd: Floats, model: Model) -> AlignedTrial:
    """The trial with another motion, (N, n) each."""
    robot = model.structure.model
    J, J_rate = robot.jacobian(theta), robot.jacobian_rate(theta, omega)
    a = np.einsum("kij,kj->ki", J, theta_dd) + np.einsum("kij,kj->ki", J_rate, omega)
    v = np.einsum("kij,kj->ki", J, omega)
    return replace(
        trial, theta=theta, omega=omega, theta_dd=theta_dd, x=robot.position(theta), v=v, a=a, source="angles"
    )


def controller(trial: AlignedTrial, structure: RobotStructure, chain: Chain) -> Law:
    """The torque as a linear law of what was commanded and of the state, by least squares over the trial.

    Of a reference: lag and its rate, each joint by itself, and the reference's own rate and acceleration. Of
    a perturbation: what it asks of the joint, and the angles and speeds of all. Whatever it misses makes the
    instruments weaker, not wrong: they follow from the commands in any case.
    """
    rate, n = trial.rate_hz, structure.model.joints
    theta, omega = trial.theta, trial.omega
    stiffness, damping = np.zeros((n, n)), np.zeros((n, n))
    rows, one = trial.valid, np.ones(len(theta))

    def law_of(joint: int, columns: list[Floats]) -> Floats:
        both = finish(chain, np.stack([*columns, trial.tau[:, joint]], axis=1), rate)
        X, y = both[rows, :-1], both[rows, -1]
        size = np.maximum(np.sqrt(np.mean(X**2, axis=0)), 1e-12)
        found: Floats = np.linalg.lstsq(X / size, y, rcond=1e-9)[0] / size
        return found

    if trial.reference is not None:
        r = chain.value(trial.reference, rate)
        r_dot, r_ddot = (
            chain.derivative(trial.reference, rate),
            chain.second_derivative(trial.reference, rate),
        )
        u = np.empty_like(theta)
        for j in range(n):
            lag, lag_rate = r[:, j] - theta[:, j], r_dot[:, j] - omega[:, j]
            kp, kd, by_rate, by_acc, offset = law_of(j, [lag, lag_rate, r_dot[:, j], r_ddot[:, j], one])
            stiffness[j, j], damping[j, j] = -kp, -kd
            u[:, j] = kp * r[:, j] + (kd + by_rate) * r_dot[:, j] + by_acc * r_ddot[:, j] + offset
        return Law(1 / rate, u, stiffness, damping)
    force = _push(trial)
    if force is None:
        raise UndeterminedError(f"trial {trial.name}: nothing says what its controller was told")
    push = np.einsum("kij,ki->kj", structure.model.jacobian(theta), force)
    u, gain = np.empty_like(theta), np.empty(n)
    for j in range(n):
        found = law_of(j, [push[:, j], *theta.T, *omega.T, one])
        gain[j], stiffness[j], damping[j], u[:, j] = found[0], found[1 : n + 1], found[n + 1 : -1], found[-1]
    return Law(1 / rate, u, stiffness, damping, force, gain)
