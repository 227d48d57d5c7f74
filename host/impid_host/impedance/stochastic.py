"""Force-perturbation trials: the spectral estimate by either sensor, held against the time domain.

The spectral part is that of [P]; with the virtual sensor's force it needs no force sensor.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.ndimage

from impid_host.errors import UndeterminedError
from impid_host.impedance.identify import LoadFit, Method, RobotParameters, identify_load
from impid_host.impedance.loads import LoadKind, arm
from impid_host.impedance.matrices import Quantity
from impid_host.impedance.periodic import Periodic, PeriodicTrial, evaluate_periodic, period_rows
from impid_host.impedance.rows import Split
from impid_host.impedance.spectral.disagreement import Disagreement, disagreement
from impid_host.impedance.spectral.estimate import (
    FIT_UPPER_HZ,
    SpectralEstimate,
    TrialSignals,
    estimate_spectral,
)
from impid_host.impedance.spectral.normality import NormalityCheck
from impid_host.impedance.spectral.second_order import SecondOrderFit
from impid_host.impedance.spectral.transforms import MARGIN, cross_spectra
from impid_host.impedance.spectral.welch import FINE, SMOOTH, WelchSetting, independent_averages
from impid_host.impedance.virtual_sensor import external_force, through_jacobian
from impid_host.robot.model import RobotModel
from impid_host.signals.align import AccelerationSource, AlignedTrial, align
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import DEFAULT, Chain
from impid_host.signals.resample import nominal_rate
from impid_host.study.model import Setup, Trial

# Spectra need the whole band of the perturbation and as much of the record as filters leave.
WIDE = replace(DEFAULT, finish=None, edge_s=0.3)
# Of two inputs; with two the spectra explain everything, noise included.
FEWEST_AVERAGES = 4.0


@dataclass(frozen=True, slots=True)
class ShakenTrial:
    """A stochastic trial for spectra: aligned without a narrow filter, and the log behind it.

    Attributes:
        log_t: robot clock of the log's rows, s, shape (N,); log_rate_hz: its rate.
        command: perturbation in those rows, N, shape (N, 2), or None.
    """

    aligned: AlignedTrial
    log_t: Floats
    log_rate_hz: float
    command: Floats | None


@dataclass(frozen=True, slots=True)
class SpectralFit:
    """One stochastic load by one method.

    Attributes:
        M, B, K: of the fit weighted by its noise, (2, 2), the handle taken off an arm's M. The intervals hold
            the uncertainty of the robot's parameters where the virtual sensor used any and it is known.
        against: the same trials' time-domain result with full matrices, beside this one.
        setting: name of the window that was used.
        periodic: what a periodic perturbation tells beyond, or None.
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
    setting: str
    periodic: Periodic | None


def shaken(
    trial: Trial, setup: Setup, model: RobotModel, source: AccelerationSource | None = None
) -> ShakenTrial:
    """Align one stochastic trial for spectra.

    Raises:
        UndeterminedError: as `align`.
    """
    log = trial.robot
    return ShakenTrial(align(trial, setup, model, WIDE, source), log.t, nominal_rate(log.t), log.perturbation)


def fit_spectral(
    trials: Sequence[AlignedTrial],
    shaken_trials: Sequence[ShakenTrial],
    on: LoadKind,
    chain: Chain,
    split: Split,
    *,
    robot: RobotParameters | None,
    handle_mass_kg: float,
) -> SpectralFit:
    """The spectral estimate over all trials of one load: with `robot` the virtual sensor, else the physical.

    Args:
        trials: aligned by `chain`, for the time domain.
        shaken_trials: the same trials for spectra.

    Raises:
        UndeterminedError: the end-effector does not move in a plane, a trial is too short for one window, or
            the perturbation leaves the matrices open.
    """
    name = trials[0].load
    if trials[0].x.shape[1] != 2:
        raise UndeterminedError(f"load {name}: stochastic trials need an end-effector that moves in a plane")
    whole = load_signals(shaken_trials, robot)
    runs = [longest_stretch(signals, one) for signals, one in zip(whole, shaken_trials, strict=True)]
    rate = trials[0].rate_hz
    window, setting = _setting(name, [len(run.force) for run in runs], rate)
    known = robot is not None and bool(np.any(robot.covariance))
    try:
        estimate = estimate_spectral(
            runs, rate, setting, slope_covariance=robot.covariance if robot is not None and known else None
        )
    except UndeterminedError as error:
        raise UndeterminedError(f"load {name}: {error}") from error
    periodic = periodic_response(whole, shaken_trials)
    if periodic is not None:
        # A few sinusoids that repeat themselves are not normally distributed, nor need they be.
        checks = tuple(check for check in estimate.checks if not isinstance(check, NormalityCheck))
        estimate = replace(estimate, checks=checks)
    handle = handle_mass_kg if on == "arm" else 0.0
    quantities = quantities_of(estimate.best.weighted_fit, handle)
    full = replace(arm(), carries_handle=on == "arm")
    timed = identify_load(trials, full, chain, split, robot=robot, handle_mass_kg=handle_mass_kg)
    return SpectralFit(
        name,
        on,
        "physical sensor" if robot is None else "virtual sensor",
        estimate,
        *quantities,
        _compare(quantities, timed),
        tuple(trial.name for trial in trials),
        window,
        periodic,
    )


def quantities_of(fit: SecondOrderFit, handle_kg: float = 0.0) -> tuple[Quantity, Quantity, Quantity]:
    """M, B, K of a spectral fit with their intervals, the handle taken off M."""
    own = handle_kg * np.eye(len(fit.M))
    return (
        Quantity(fit.M - own, fit.ci95("M") - own[:, :, np.newaxis], "kg", fit.M_sd),
        Quantity(fit.B, fit.ci95("B"), "N*s/m", fit.B_sd),
        Quantity(fit.K, fit.ci95("K"), "N/m", fit.K_sd),
    )


def load_signals(trials: Sequence[ShakenTrial], robot: RobotParameters | None) -> list[TrialSignals]:
    """Force of the robot on the load by virtual or physical sensor, with the motion, over whole trials.

    A row of the log holds means over its period; the mean's gain is taken off, and so is what the mean makes
    of a perturbation that is held from row to row.

    Raises:
        UndeterminedError: no forces were logged and no robot is given.
    """
    signals = [_signals(one, robot) for one in trials]
    if not all(held_by_rows(one.command) for one in trials):
        return signals
    share = np.eye(2) if robot is not None else _passed_on(signals, trials)
    return [
        replace(s, force=s.force + _staircase(s.perturbation, share, one))
        for s, one in zip(signals, trials, strict=True)
        if s.perturbation is not None
    ]


def held_by_rows(command: Floats | None) -> bool:
    """Whether a logged command is a new one in nearly every row; then it was held from row to row."""
    if command is None:
        return False
    active = np.any(command != 0.0, axis=1)
    new = np.any(np.diff(command, axis=0) != 0.0, axis=1)
    return bool(np.sum(active) > 100 and np.mean(new[active[1:]]) > 0.9)


def _passed_on(signals: Sequence[TrialSignals], trials: Sequence[ShakenTrial]) -> Floats:
    """The share of a fast perturbation that reaches the load: T near the band's end, real, (2, 2)."""
    runs = [longest_stretch(s, one) for s, one in zip(signals, trials, strict=True)]
    rate = trials[0].aligned.rate_hz
    setting = SMOOTH.scaled(rate)
    if min(len(run.force) for run in runs) < setting.n_window + 2 * MARGIN:
        return np.zeros((2, 2))
    p, F = ([getattr(run, name) for run in runs] for name in ("perturbation", "force"))
    S_pp, S_Fp = (
        np.sum([cross_spectra(a, b, rate, setting)[1] for a, b in zip(x, p, strict=True)], axis=0)
        for x in (p, F)
    )
    f = np.arange(setting.n_fft // 2 + 1) * rate / setting.n_fft
    near = (f > 0.8 * FIT_UPPER_HZ) & (f <= FIT_UPPER_HZ)
    return np.asarray(np.real(np.sum(S_Fp[near], axis=0) @ np.linalg.inv(np.sum(S_pp[near], axis=0))))


def _staircase(p: Floats, share: Floats, one: ShakenTrial) -> Floats:
    """What is missing of a force whose part `share` p follows the staircase that plays p, N, (N, 2).

    The mean over a period centred on a switching instant is (p[k-1] + p[k]) / 2, of gain cos(pi f T); the
    staircase's own part at f has sinc(f T). The undone mean is short by (pi f T)^2 / 6 of it: 7e-4 at 10 Hz.
    """
    rate = one.aligned.rate_hz
    T = 1.0 / one.log_rate_hz
    bend = scipy.ndimage.convolve1d(p, np.array([1.0, -2.0, 1.0]) * rate**2, axis=0, mode="nearest")
    late = np.roll(bend, round(0.5 * T * rate), axis=0)
    return np.asarray(-(T**2 / 24.0) * late @ share.T)


def _signals(one: ShakenTrial, robot: RobotParameters | None) -> TrialSignals:
    """Of one trial, the mean's gain taken off.

    Raises:
        UndeterminedError: no forces were logged and no robot is given.
    """
    trial = one.aligned
    rows = trial.rate_hz / one.log_rate_hz
    if robot is None:
        if trial.force is None:
            raise UndeterminedError(f"trial {trial.name}: no fx, fy in robot.csv for Method 2")
        return TrialSignals(-_unaveraged(trial.force, rows), trial.x, trial.perturbation)
    model = robot.structure.model
    Y = robot.structure.regressor(trial.theta, trial.omega, trial.theta_dd, 1 / trial.rate_hz)
    force = external_force(model, trial.theta, Y, robot.value, _unaveraged(trial.tau, rows))
    slope = -through_jacobian(model, trial.theta, Y)
    return TrialSignals(-force, trial.x, trial.perturbation, slope)


def _unaveraged(x: Floats, period: float) -> Floats:
    """Undo the mean over `period` samples to second order in frequency: 1 / sinc(f T) = 1 + (pi f T)^2 / 6.

    At 25 Hz and 500 rows a second 1e-5 of the 0.4 % are left.
    """
    c = period**2 / 24.0
    return np.asarray(scipy.ndimage.convolve1d(x, np.array([-c, 1.0 + 2.0 * c, -c]), axis=0, mode="nearest"))


def _setting(name: str, lengths: Sequence[int], rate: float) -> tuple[str, WelchSetting]:
    """[P]'s long window where the trials hold enough of them, else the short one."""
    for label, setting in (("long window", FINE.scaled(rate)), ("short window", SMOOTH.scaled(rate))):
        # Some samples more, which the derivatives take.
        own = [length - 2 * MARGIN for length in lengths]
        if (
            min(own) >= setting.n_window
            and sum(independent_averages(setting, n) for n in own) >= FEWEST_AVERAGES
        ):
            return label, setting
    window_s = SMOOTH.scaled(rate).n_window / rate
    raise UndeterminedError(
        f"load {name}: {len(lengths)} trial(s) of {min(lengths) / rate:.1f} s and more are too short for "
        f"spectra; each needs an unbroken stretch of {window_s:.1f} s, all together about "
        f"{3 * window_s:.0f} s: record longer trials"
    )


def longest_stretch(signals: TrialSignals, one: ShakenTrial) -> TrialSignals:
    """The longest unbroken stretch."""
    run = _longest(one.aligned)
    p, slope = signals.perturbation, signals.force_slope
    return TrialSignals(
        signals.force[run],
        signals.displacement[run],
        None if p is None else p[run],
        None if slope is None else slope[run],
    )


def _longest(trial: AlignedTrial) -> slice:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], trial.valid.astype(np.int8), [0]])))
    if len(edges) == 0:
        raise UndeterminedError(f"trial {trial.name}: nothing is left between gaps and filter edges")
    longest = int(np.argmax(edges[1::2] - edges[::2]))
    return slice(int(edges[2 * longest]), int(edges[2 * longest + 1]))


def periodic_response(whole: Sequence[TrialSignals], trials: Sequence[ShakenTrial]) -> Periodic | None:
    """The evaluation of periodic perturbations, where every trial has one and they are orthogonal."""
    rows = [period_rows(one.command) for one in trials]
    if len(set(rows)) != 1 or rows[0] is None:
        return None
    parts = []
    for signals, one in zip(whole, trials, strict=True):
        run = _longest(one.aligned)
        robot_t = one.aligned.t if one.aligned.clock is None else one.aligned.clock.to_robot(one.aligned.t)
        if one.command is None:
            return None
        parts.append(
            PeriodicTrial(robot_t[run], signals.force[run], signals.displacement[run], one.log_t, one.command)
        )
    return evaluate_periodic(parts, rows[0])


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
