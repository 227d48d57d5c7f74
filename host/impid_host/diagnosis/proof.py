"""What a study would report with given effects taken out, and its error on data that took no part.

The same estimators as `impid-host fit`, accelerations from the accelerometer where there is one: stage 0 is
what the papers' model gives, and every later stage is the same with corrected signals.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from impid_host.diagnosis.base import Base
from impid_host.diagnosis.correct import corrected
from impid_host.diagnosis.holdout import FIT, SEALED, Holdout, settled
from impid_host.diagnosis.own_robot import estimate_robot, given_robot, shows_robot
from impid_host.diagnosis.parameters import parameters_of
from impid_host.diagnosis.propagate import moved_fits
from impid_host.diagnosis.result import Chosen, Number
from impid_host.effects.catalogue import CATALOGUE
from impid_host.effects.encoder import resynchronised
from impid_host.effects.view import View
from impid_host.impedance.identify import RobotParameters, physical_equation, robot_equation, virtual_equation
from impid_host.impedance.linear import Estimate, Stretch, fit_linear
from impid_host.impedance.loads import LoadModel
from impid_host.impedance.matrices import load_matrices
from impid_host.impedance.rows import SERIES_RATE_HZ, Equation, series, stretches
from impid_host.signals.align import AlignedTrial, base_frame_acceleration, joint_acceleration
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import DEFAULT, Chain

Numbers = tuple[
    Number,
    Mapping[str, Mapping[str, Number]],
    dict[str, float],
    dict[str, float],
    tuple[str, ...],
    Mapping[str, Floats],
]


def in_time(view: View, chosen: Sequence[Chosen]) -> View:
    """Where the clocks drift, the robot's signals by the path that the angles show, held-out parts as well.

    Matching clocks is part of alignment, and needs no torque.
    """
    drifts = any(CATALOGUE[part.term.effect].acts_on == "clock" for part in chosen if part.term.named)
    return resynchronised(view) if drifts else view


def chain_of(view: View) -> Chain:
    """The chain of `fit`, in the band that this study is reported in."""
    return DEFAULT.with_cutoff(view.report_hz)


def aligned(view: View) -> AlignedTrial:
    """The view as `fit` sees a trial: accelerations by the accelerometer where there is one."""
    acc, a = view.acc, view.a
    if view.measured is not None and view.predicted is not None and view.sensor_angle is not None:
        a = base_frame_acceleration(view.measured, view.sensor_angle, view.model.plane_gravity_m_s2)
        J_rate = view.model.jacobian_rate(view.theta, view.omega)
        acc = joint_acceleration(a, view.J, J_rate, view.omega)
    chain = chain_of(view)
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


@dataclass(frozen=True, slots=True)
class StageFit:
    """Robot and loads as `fit` finds them in corrected signals.

    Attributes:
        alpha: None where the robot is known from elsewhere; loads: by name.
        free, virtual, physical: their equations, virtual and physical by load.
    """

    alpha: Estimate | None
    robot: RobotParameters
    loads: dict[str, Estimate]
    free: list[tuple[View, Equation]]
    virtual: dict[str, list[tuple[View, Equation]]]
    physical: dict[str, list[tuple[View, Equation]]]


def report(
    views: Sequence[View],
    chosen: Sequence[Chosen],
    base: Base,
    holdout: Holdout,
    *,
    handle_mass_kg: float,
    prior: Sequence[float] | None,
    spread: Mapping[str, float],
    covariance: Floats | None = None,
) -> Numbers:
    """alpha, loads, validation rms and VAF, names of alpha, and values of the loads, effects taken out.

    Args:
        spread: variance of each channel as it was measured (see `spreads`), the same measure for every stage.
        covariance: (k, k) of all effects' parameters, for the intervals of alpha and the loads; None: known
            exactly.

    Raises:
        UndeterminedError: the fit part does not determine the parameters.
    """
    fit = fitted(views, chosen, base, holdout, prior)
    if covariance is not None and len(covariance):
        fit = _widened(fit, views, chosen, covariance, base, holdout, prior)
    errors = _errors(fit, base, holdout)
    rms = {key: error.rms for key, error in errors.items()}
    vaf = {key: _vaf(error.variance, spread[key]) for key, error in errors.items()}
    loads = {
        name: total(load, name, _load_numbers(load, fit.loads[name], handle_mass_kg), chosen)
        for name, load in base.loads
    }
    names = base.structure.parameter_names if fit.alpha is None else fit.alpha.names
    values = {name: estimate.value for name, estimate in fit.loads.items()}
    return _alpha_number(fit), loads, rms, vaf, names, values


def spreads(
    views: Sequence[View], base: Base, holdout: Holdout, prior: Sequence[float] | None
) -> dict[str, float]:
    """How much each reported channel varies on held-out data as it was measured, no effect taken out."""
    errors = _errors(fitted(views, [], base, holdout, prior), base, holdout)
    return {key: error.spread for key, error in errors.items()}


@dataclass(frozen=True, slots=True)
class _Error:
    """Of one channel on held-out data: rms and variance of the residual; spread: variance of the target."""

    rms: float
    variance: float
    spread: float


def _errors(fit: StageFit, base: Base, holdout: Holdout) -> dict[str, _Error]:
    result: dict[str, _Error] = {}
    if fit.free:
        target, residual = _held(fit.free, fit.robot.value, holdout)
        for joint in range(base.model.joints):
            result[f"tau{joint + 1}"] = _error(residual[:, joint], float(np.var(target[:, joint])))
    held: dict[str, list[tuple[Floats, Floats]]] = {}
    for name, _ in base.loads:
        virtual = fit.virtual[name]
        held.setdefault("f", []).append(_held(virtual, fit.loads[name].value, holdout))
        if name in fit.physical:
            both = [
                (view, Equation(eq.trial, np.zeros((*eq.target.shape, 1)), eq.target - other.target))
                for (view, eq), (_, other) in zip(virtual, fit.physical[name], strict=True)
            ]
            held.setdefault("fs", []).append(_held(both, np.zeros(1), holdout, of=virtual))
    has_torque = bool(fit.free)
    for start, parts in held.items():
        residual = np.concatenate([part[1] for part in parts])
        spread = np.mean([np.var(part[0], axis=0) for part in parts], axis=0)
        for axis, letter in enumerate(base.model.task_axes):
            key = channel(start, letter, has_torque=has_torque)
            result[key] = _error(residual[:, axis], float(spread[axis]))
    return result


def _vaf(left: float, spread: float) -> float:
    """[D] eq. 8, %; a joint without a drive logs zeros, of which nothing can be accounted for."""
    if spread <= 0.0:
        return 0.0 if left > 0.0 else 100.0
    return float(100 * (1 - left / spread))


def _error(residual: Floats, spread: float) -> _Error:
    if len(residual) == 0:
        return _Error(0.0, 0.0, 1.0)
    return _Error(float(np.sqrt(np.mean(residual**2))), float(np.var(residual)), spread)


def total(load: LoadModel, name: str, own: dict[str, Number], chosen: Sequence[Chosen]) -> dict[str, Number]:
    """A load's matrices with what effects of the load add to them: the load's own model is not all of it."""
    d = len(load.axes)
    result = dict(own)
    for part in chosen:
        letters = CATALOGUE[part.term.effect].adds_to if part.term.named else ()
        numbers = parameters_of(part) if letters and load.name == "mass-spring" else {}
        for letter in letters:
            more = numbers.get(letter)
            if more is not None and not isinstance(more, Number):
                more = more.get(name)
            if more is None:
                continue
            half, value = _square(more.half, d), _square(more.value, d)
            if letter in result:
                before = result[letter]
                half = np.hypot(half, before.half)
                value = value + before.value
            result[letter] = Number(value, np.stack([value - half, value + half], axis=-1), more.unit)
    return result


def _square(values: Floats, d: int) -> Floats:
    """One number for all axes, or one for each, or a matrix: as a matrix (d, d)."""
    return values if values.ndim == 2 else np.asarray(values * np.eye(d), dtype=np.float64)


def channel(start: str, letter: str, *, has_torque: bool) -> str:
    """`fx`, `fsx`; a rotary joint's load is a torque against an angle, and its error one of torque."""
    if letter != "theta":
        return start + letter
    return "tau1_load" if has_torque else "tau1"


def fitted(
    views: Sequence[View],
    chosen: Sequence[Chosen],
    base: Base,
    holdout: Holdout,
    prior: Sequence[float] | None,
    ar_order: int | None = None,
) -> StageFit:
    """Robot and loads by the estimators of `fit`, with the chosen effects taken out of the signals.

    Args:
        ar_order: highest order of the residual's autoregression; the chain's where it is None.
    """
    chain = chain_of(views[0])
    chain = chain if ar_order is None else replace(chain, ar_order=ar_order)
    cleaned = [in_time(corrected(view, chosen), chosen) for view in views]
    pairs = [(view, aligned(clean)) for view, clean in zip(views, cleaned, strict=True)]
    structure = base.structure
    # Effects of the geometry change the robot itself: its regressor and its Jacobian, trial by trial.
    robots = {clean.name: replace(structure, model=clean.model) for clean in cleaned}
    known = prior is not None and all(view.load is not None for view in views)
    shown = [] if known else shows_robot(list(zip(cleaned, (trial for _, trial in pairs), strict=True)))
    logged = {view.name: view for view in views}
    own = [(logged[clean.name], robot_equation(trial, robots[clean.name], chain)) for clean, trial in shown]
    alpha = None
    if own:
        alpha = estimate_robot(_rows(own, holdout, chain), structure, chain)
        origin: Literal["free trials", "force sensor"] = (
            "free trials" if own[0][0].load is None else "force sensor"
        )
        robot = RobotParameters(structure, alpha.value, alpha.covariance, origin)
    else:
        robot = given_robot(base, prior)
    free = [(view, equation) for view, equation in own if view.load is None]
    loads = {}
    virtual: dict[str, list[tuple[View, Equation]]] = {}
    physical: dict[str, list[tuple[View, Equation]]] = {}
    for name, load in base.loads:
        members = [(view, trial) for view, trial in pairs if view.load == name]
        virtual[name] = [
            (view, virtual_equation(trial, replace(robot, structure=robots[view.name]), load, chain))
            for view, trial in members
        ]
        loads[name] = _estimate(
            virtual[name], holdout, load.parameter_names, load.parameter_units, chain, robot.covariance
        )
        if all(trial.force is not None for _, trial in members):
            physical[name] = [
                (view, physical_equation(own.trial, load, chain, own.design)) for view, own in virtual[name]
            ]
    return StageFit(alpha, robot, loads, free, virtual, physical)


def _widened(
    fit: StageFit,
    views: Sequence[View],
    chosen: Sequence[Chosen],
    covariance: Floats,
    base: Base,
    holdout: Holdout,
    prior: Sequence[float] | None,
) -> StageFit:
    """The fit, with the effects' uncertainty propagated into its covariances.

    Slopes by ordinary least squares, whose weights do not move.
    """

    def plainly(present: Sequence[Chosen]) -> StageFit:
        return fitted(views, present, base, holdout, prior, ar_order=0)

    steps, here, moved = moved_fits(chosen, covariance, plainly)
    alpha = None
    if fit.alpha is not None and here.alpha is not None:
        alpha = steps.wider(fit.alpha, here.alpha, [o.alpha for o in moved if o.alpha is not None])
    loads = {
        name: steps.wider(own, here.loads[name], [other.loads[name] for other in moved])
        for name, own in fit.loads.items()
    }
    return replace(fit, alpha=alpha, loads=loads)


def _alpha_number(fit: StageFit) -> Number:
    if fit.alpha is not None:
        return Number(fit.alpha.value, fit.alpha.ci95, "SI", fit.alpha.covariance)
    return Number(fit.robot.value, np.stack([fit.robot.value, fit.robot.value], axis=1), "SI")


def _estimate(
    equations: Sequence[tuple[View, Equation]],
    holdout: Holdout,
    names: tuple[str, ...],
    units: tuple[str, ...],
    chain: Chain,
    covariance: Floats,
) -> Estimate:
    rows = _rows(equations, holdout, chain)
    return fit_linear(rows, names, units, ar_order=chain.ar_order, nuisance_covariance=covariance)


def _rows(equations: Sequence[tuple[View, Equation]], holdout: Holdout, chain: Chain) -> list[Stretch]:
    return [
        stretch
        for view, equation in equations
        for stretch in stretches(equation, holdout.mask(view, FIT) & equation.trial.valid, chain)
    ]


def _held(
    equations: Sequence[tuple[View, Equation]],
    value: Floats,
    holdout: Holdout,
    of: Sequence[tuple[View, Equation]] | None = None,
) -> tuple[Floats, Floats]:
    """Target (of the equations `of`, where given) and residual on the held-out rows, (N, c) each."""
    targets, residuals = [], []
    for index, (view, equation) in enumerate(equations):
        part = series(equation, value, holdout.mask(view, SEALED) & equation.trial.valid)
        rows = part.held_out
        other = equation if of is None else of[index][1]
        targets.append(other.target[:: max(1, round(view.rate_hz / SERIES_RATE_HZ))][rows])
        residuals.append((part.target - part.fit)[rows])
    return np.concatenate(targets), np.concatenate(residuals)


def _load_numbers(load: LoadModel, estimate: Estimate, handle_mass_kg: float) -> dict[str, Number]:
    matrices = load_matrices(load, estimate, handle_mass_kg)
    quantities = {"M": matrices.M, "B": matrices.B, "K": matrices.K, "x0": matrices.x0}
    return {name: Number(q.value, q.ci95, q.unit) for name, q in quantities.items() if q is not None}
