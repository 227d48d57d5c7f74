"""What a study would report with given effects taken out, and its error on data that took no part.

The same estimators as `impid-host fit`, accelerations from the accelerometer where there is one: stage 0 is
what the papers' model gives, and every later stage is the same with corrected signals.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from impid_host.diagnosis.base import Base, equilibrium
from impid_host.diagnosis.holdout import Holdout, settled
from impid_host.diagnosis.result import Chosen, Number
from impid_host.effects.view import View
from impid_host.errors import UndeterminedError
from impid_host.impedance.identify import RobotParameters, physical_equation, robot_equation, virtual_equation
from impid_host.impedance.linear import Estimate, fit_linear
from impid_host.impedance.loads import LoadModel
from impid_host.impedance.rows import SERIES_RATE_HZ, Equation, series, stretches
from impid_host.robot.terms import RobotStructure
from impid_host.signals.align import AlignedTrial, joint_acceleration
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import DEFAULT, Chain

Numbers = tuple[Number, Mapping[str, Mapping[str, Number]], dict[str, float], dict[str, float]]


def corrected(view: View, chosen: Sequence[Chosen]) -> View:
    """The trial as it would have been measured without the chosen effects."""
    for part in chosen:
        if part.candidate.undo is not None:
            view = part.candidate.undo(view, part.beta)
    for part in chosen:
        if part.candidate.undo is not None:
            continue
        columns = part.candidate.columns(view, part.shape)
        if "torque" in columns:
            view = replace(view, tau=view.tau - columns["torque"] @ part.beta)
        if "specific_force" in columns and view.measured is not None:
            view = replace(view, measured=view.measured - columns["specific_force"] @ part.beta)
        if "force" in columns and view.force is not None:
            view = replace(view, force=view.force + columns["force"] @ part.beta)
    return view


def aligned(view: View) -> AlignedTrial:
    """The view as `fit` sees a trial: accelerations by the accelerometer where there is one."""
    acc, a = view.acc, view.a
    if view.measured is not None and view.predicted is not None and view.sensor_angle is not None:
        c, s = np.cos(view.sensor_angle), np.sin(view.sensor_angle)
        first, second = view.measured.T
        a = np.stack([c * first - s * second, s * first + c * second], axis=1)
        J_rate = view.model.jacobian_rate(view.theta, view.omega)
        acc = joint_acceleration(a, view.J, J_rate, view.omega)
    chain = DEFAULT
    return AlignedTrial(
        name=view.name,
        kind=view.kind,  # type: ignore[arg-type]
        load=view.load or view.name,
        t=view.t,
        rate_hz=view.rate_hz,
        theta=view.theta,
        omega=view.omega,
        theta_dd=acc,
        tau=view.tau,
        force=view.force if view.load is not None else None,
        perturbation=None,
        x=view.x,
        v=view.v,
        a=a,
        valid=settled(view.valid, view.rate_hz, chain.edge_s),
        source="accelerometer" if view.measured is not None else "angles",
        clock=None,
    )


def report(
    views: Sequence[View],
    chosen: Sequence[Chosen],
    base: Base,
    holdout: Holdout,
    *,
    handle_mass_kg: float,
    prior: Sequence[float] | None,
) -> Numbers:
    """alpha, loads, validation rms and VAF with the chosen effects taken out.

    Raises:
        UndeterminedError: the fit part does not determine the parameters.
    """
    chain = DEFAULT
    pairs = [(view, aligned(corrected(view, chosen))) for view in views]
    rms: dict[str, float] = {}
    vaf: dict[str, float] = {}
    structure = RobotStructure(base.model)
    free = [(view, robot_equation(trial, structure, chain)) for view, trial in pairs if view.load is None]
    if free:
        estimate = _estimate(free, holdout, structure.parameter_names, structure.parameter_units, chain, None)
        robot = RobotParameters(structure, estimate.value, estimate.covariance, "free trials")
        names = [f"tau{joint + 1}" for joint in range(base.model.joints)]
        _judge(free, estimate.value, holdout, names, rms, vaf)
        alpha = Number(estimate.value, estimate.ci95, "SI")
    else:
        robot = _prior(structure, prior)
        alpha = Number(robot.value, np.stack([robot.value, robot.value], axis=1), "SI")
    loads: dict[str, dict[str, Number]] = {}
    held: dict[str, list[tuple[Floats, Floats]]] = {}
    for name, load in base.loads:
        members = [(view, trial) for view, trial in pairs if view.load == name]
        virtual = [(view, virtual_equation(trial, robot, load, chain)) for view, trial in members]
        estimate = _estimate(
            virtual, holdout, load.parameter_names, load.parameter_units, chain, robot.covariance
        )
        loads[name] = _load_numbers(load, estimate, handle_mass_kg)
        held.setdefault("f", []).append(_held(virtual, estimate.value, holdout))
        if all(trial.force is not None for _, trial in members):
            physical = [(view, physical_equation(trial, load, chain)) for view, trial in members]
            both = [
                (
                    view,
                    Equation(eq.trial, np.zeros((*eq.target.shape, 1)), eq.target - other.target),
                )
                for (view, eq), (_, other) in zip(virtual, physical, strict=True)
            ]
            held.setdefault("fs", []).append(_held(both, np.zeros(1), holdout, of=virtual))
    for start, parts in held.items():
        target = np.concatenate([part[0] for part in parts])
        residual = np.concatenate([part[1] for part in parts])
        spread = np.mean([np.var(part[0], axis=0) for part in parts], axis=0)
        for axis, letter in enumerate(base.model.task_axes):
            rms[start + letter] = float(np.sqrt(np.mean(residual[:, axis] ** 2))) if len(target) else 0.0
            vaf[start + letter] = _vaf(residual[:, axis], float(spread[axis]))
    return alpha, loads, rms, vaf


def _estimate(
    equations: Sequence[tuple[View, Equation]],
    holdout: Holdout,
    names: tuple[str, ...],
    units: tuple[str, ...],
    chain: Chain,
    covariance: Floats | None,
) -> Estimate:
    rows = [
        stretch
        for view, equation in equations
        for stretch in stretches(equation, holdout.mask(view, "fit") & equation.trial.valid, chain)
    ]
    return fit_linear(rows, names, units, ar_order=chain.ar_order, nuisance_covariance=covariance)


def _held(
    equations: Sequence[tuple[View, Equation]],
    value: Floats,
    holdout: Holdout,
    of: Sequence[tuple[View, Equation]] | None = None,
) -> tuple[Floats, Floats]:
    """Target (of the equations `of`, where given) and residual on the held-out rows, (N, c) each."""
    targets, residuals = [], []
    for index, (view, equation) in enumerate(equations):
        part = series(equation, value, holdout.mask(view, "validation") & equation.trial.valid)
        rows = part.held_out
        other = equation if of is None else of[index][1]
        targets.append(other.target[:: max(1, round(view.rate_hz / SERIES_RATE_HZ))][rows])
        residuals.append((part.target - part.fit)[rows])
    return np.concatenate(targets), np.concatenate(residuals)


def _judge(
    equations: Sequence[tuple[View, Equation]],
    value: Floats,
    holdout: Holdout,
    names: Sequence[str],
    rms: dict[str, float],
    vaf: dict[str, float],
) -> None:
    target, residual = _held(equations, value, holdout)
    for channel, name in enumerate(names):
        rms[name] = float(np.sqrt(np.mean(residual[:, channel] ** 2)))
        vaf[name] = _vaf(residual[:, channel], float(np.var(target[:, channel])))


def _vaf(residual: Floats, spread: float) -> float:
    return float(100 * (1 - np.var(residual) / max(spread, 1e-300)))


def _load_numbers(load: LoadModel, estimate: Estimate, handle_mass_kg: float) -> dict[str, Number]:
    result = {}
    for letter, signal, unit in (("M", "a", "kg"), ("B", "v", "N*s/m"), ("K", "x", "N/m")):
        S = load.matrix_map(signal)  # type: ignore[arg-type]
        if not S.any():
            continue
        value = S @ estimate.value
        half = stats.t.ppf(0.975, estimate.dof) * np.sqrt(np.diag(S @ estimate.covariance @ S.T))
        handle = handle_mass_kg * np.eye(2) if load.carries_handle and letter == "M" else np.zeros((2, 2))
        interval = np.stack([value - half, value + half], axis=1).reshape(2, 2, 2)
        result[letter] = Number(value.reshape(2, 2) - handle, interval - handle[:, :, None], unit)
    result["x0"] = _place(load, estimate)
    return result


def _place(load: LoadModel, estimate: Estimate) -> Number:
    x0, K = equilibrium(load, estimate.value)
    S = load.matrix_map("x").reshape(2, 2, -1)
    slope = -np.einsum("ijq,j->iq", S, x0)
    slope[:, [load.parameter_names.index("cx"), load.parameter_names.index("cy")]] += np.eye(2)
    slope = np.linalg.solve(K, slope)
    half = stats.t.ppf(0.975, estimate.dof) * np.sqrt(np.diag(slope @ estimate.covariance @ slope.T))
    return Number(x0, np.stack([x0 - half, x0 + half], axis=1), "m")


def _prior(structure: RobotStructure, prior: Sequence[float] | None) -> RobotParameters:
    size = len(structure.parameter_names)
    if prior is None or len(prior) != size:
        raise UndeterminedError(
            f"no free trial and no [prior] alpha of {size} values in setup.toml, so the robot is unknown; "
            "record a free trial"
        )
    return RobotParameters(structure, np.array(prior), np.zeros((size, size)), "prior")
