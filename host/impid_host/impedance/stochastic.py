"""Force-perturbation trials: the spectral estimate by either sensor, held against the time domain.

The spectral part is that of [P]; with the virtual sensor's force it needs no force sensor.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.identify import LoadFit, Method, RobotParameters, identify_load
from impid_host.impedance.loads import LoadKind, arm
from impid_host.impedance.matrices import Quantity
from impid_host.impedance.rows import Split
from impid_host.impedance.spectral.disagreement import Disagreement, disagreement
from impid_host.impedance.spectral.estimate import SpectralEstimate, TrialSignals, estimate_spectral
from impid_host.impedance.spectral.welch import FINE, SMOOTH
from impid_host.impedance.virtual_sensor import external_force
from impid_host.signals.align import AlignedTrial
from impid_host.signals.chain import Chain

_NORMAL_95 = 1.959964


@dataclass(frozen=True, slots=True)
class SpectralFit:
    """One stochastic load by one method.

    Attributes:
        M, B, K: of the fit weighted by its noise, (2, 2), the handle taken off an arm's M. With the virtual
            sensor the intervals leave out the uncertainty of the robot's parameters.
        against: the same trials' time-domain result with full matrices, beside this one.
    """

    load: str
    on: LoadKind
    method: Method
    estimate: SpectralEstimate
    M: Quantity
    B: Quantity
    K: Quantity
    against: Disagreement
    trials: tuple[str, ...]


def fit_spectral(
    trials: Sequence[AlignedTrial],
    on: LoadKind,
    chain: Chain,
    split: Split,
    *,
    robot: RobotParameters | None,
    handle_mass_kg: float,
) -> SpectralFit:
    """The spectral estimate over all trials of one load: with `robot` the virtual sensor, else the physical.

    Raises:
        UndeterminedError: the end-effector does not move in a plane, a trial is too short for one window, or
            the perturbation leaves the matrices open.
    """
    name = trials[0].load
    if trials[0].x.shape[1] != 2:
        raise UndeterminedError(f"load {name}: stochastic trials need an end-effector that moves in a plane")
    rate = trials[0].rate_hz
    runs = [_signals(trial, robot) for trial in trials]
    setting = next(
        (
            s
            for s in (FINE.scaled(rate), SMOOTH.scaled(rate))
            if all(len(r.force) >= s.n_window for r in runs)
        ),
        None,
    )
    if setting is None:
        longest = max(len(run.force) for run in runs) / rate
        raise UndeterminedError(
            f"load {name}: the longest unbroken stretch is {longest:.1f} s; spectra need at least "
            f"{SMOOTH.scaled(rate).n_window / rate:.1f} s in every stochastic trial"
        )
    estimate = estimate_spectral(runs, rate, setting)
    best = estimate.best.weighted_fit
    handle = handle_mass_kg if on == "arm" else 0.0
    method: Method = "physical sensor" if robot is None else "virtual sensor"
    quantities = (
        _quantity(best.M - handle * np.eye(2), best.M_sd, "kg"),
        _quantity(best.B, best.B_sd, "N*s/m"),
        _quantity(best.K, best.K_sd, "N/m"),
    )
    full = replace(arm(), carries_handle=on == "arm")
    timed = identify_load(trials, full, chain, split, robot=robot, handle_mass_kg=handle_mass_kg)
    against = _compare(quantities, timed)
    return SpectralFit(
        name, on, method, estimate, *quantities, against, tuple(trial.name for trial in trials)
    )


def _compare(spectral: tuple[Quantity, Quantity, Quantity], timed: LoadFit) -> Disagreement:
    assert timed.B is not None
    names = tuple(f"{m}{i}{j}" for m in "MBK" for i in "xy" for j in "xy")
    own = (timed.M, timed.B, timed.K)
    return disagreement(
        ("time domain", "spectral"),
        tuple(f"{name} ({unit})" for name, unit in zip(names, _units(own), strict=True)),
        (np.concatenate([q.value.ravel() for q in own]), np.concatenate([q.sd.ravel() for q in own])),
        (
            np.concatenate([q.value.ravel() for q in spectral]),
            np.concatenate([q.sd.ravel() for q in spectral]),
        ),
    )


def _units(quantities: Sequence[Quantity]) -> list[str]:
    return [quantity.unit for quantity in quantities for _ in range(4)]


def _quantity(value: np.ndarray, sd: np.ndarray, unit: str) -> Quantity:
    half = _NORMAL_95 * sd
    return Quantity(value, np.stack([value - half, value + half], axis=-1), unit, sd)


def _signals(trial: AlignedTrial, robot: RobotParameters | None) -> TrialSignals:
    """Force of the robot on the load over the trial's longest unbroken stretch."""
    if robot is None:
        if trial.force is None:
            raise UndeterminedError(f"trial {trial.name}: no fx, fy in robot.csv for Method 2")
        force = trial.force
    else:
        Y = robot.structure.regressor(trial.theta, trial.omega, trial.theta_dd)
        force = external_force(robot.structure.model, trial.theta, Y, robot.value, trial.tau)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], trial.valid.astype(np.int8), [0]])))
    if len(edges) == 0:
        raise UndeterminedError(f"trial {trial.name}: nothing is left between gaps and filter edges")
    longest = int(np.argmax(edges[1::2] - edges[::2]))
    run = slice(int(edges[2 * longest]), int(edges[2 * longest + 1]))
    return TrialSignals(
        -force[run], trial.x[run], None if trial.perturbation is None else trial.perturbation[run]
    )
