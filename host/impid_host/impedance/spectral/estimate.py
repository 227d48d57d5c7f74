"""From the signals of one or more force-perturbation trials to impedance, coherences, fit and checks.

The steps of [P] in their order; each step's algebra is in the file of its name.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.agreement import Agreement, agreement
from impid_host.impedance.spectral.arrays import Complexes, Floats
from impid_host.impedance.spectral.coherence import (
    multiple_coherence,
    partial_coherence,
    zero_coherence_level,
)
from impid_host.impedance.spectral.frequency_response import direct_response, impedance, noise_spectrum
from impid_host.impedance.spectral.normality import NormalityCheck, normality
from impid_host.impedance.spectral.random_error import random_error
from impid_host.impedance.spectral.repeatability import RepeatabilityCheck, repeatability
from impid_host.impedance.spectral.second_order import (
    SecondOrderFit,
    fit_second_order,
    second_order_impedance,
)
from impid_host.impedance.spectral.stationarity import StationarityCheck, stationarity
from impid_host.impedance.spectral.surrogates import Loop, with_intervals
from impid_host.impedance.spectral.transforms import MARGIN, Sampling, Transforms, pooled, transform_trial
from impid_host.impedance.spectral.weighted_fit import (
    Quiet,
    Task,
    fit_weighted,
    predicted,
    projected,
    solve,
)
from impid_host.impedance.spectral.welch import FINE, WelchSetting, independent_averages

FIT_UPPER_HZ = 10.0
# [P]'s perturbation ends at 15 Hz; far beyond, ratios of two nothings say nothing.
UPPER_HZ = 25.0
AGREEMENT_UPPER_HZ = (5.0, 10.0)
# They know a standard deviation to 11 %, which Student's t accounts for.
SURROGATES = 40


@dataclass(frozen=True, slots=True)
class TrialSignals:
    """One stochastic trial on a uniform grid.

    Attributes:
        force: F, force of the robot on the arm or load (N), shape (N, n): the negative of a study's
            fx, fy; from a force sensor or from the virtual one.
        displacement: d, position of the end-effector (m), shape (N, n).
        perturbation: F_delta, commanded perturbation (N), shape (N, n), or None where it was not logged.
        force_slope: d force / d (parameters of the robot) where a virtual sensor gave it, shape (N, n, k).
    """

    force: Floats
    displacement: Floats
    perturbation: Floats | None = None
    force_slope: Floats | None = None

    def __post_init__(self) -> None:
        commanded = () if self.perturbation is None else (self.perturbation,)
        for signal in (self.force, self.displacement, *commanded):
            if signal.shape != self.force.shape:
                raise ValueError(f"signals of shapes {self.force.shape} and {signal.shape} must agree")
            if not np.all(np.isfinite(signal)):
                raise UndeterminedError(
                    "a stochastic trial has missing samples; spectra need an unbroken record, cut or fill it"
                )


@dataclass(frozen=True, slots=True)
class ResponseEstimate:
    """One estimate of the compliance C and what follows from it.

    Attributes:
        C: dynamic compliance from force to displacement (m/N), shape (n_f, n, n).
        partial_coherence: gamma^2 of input j on output i, shape (n_f, n, n).
        multiple_coherence: gamma^2 of all inputs on output i, shape (n_f, n).
        random_error: normalised, of each element of C, shape (n_f, n, n).
        Z: impedance (N s/m) at the frequencies of the fit's band, shape (n_b, n, n).
        fit: second-order model by [P]'s appendix.
        weighted_fit: second-order model by weighted least squares on the cross-spectra; the better numbers.
        agreement: of the expected model, where given, else of the fitted one, over 0-5 and 0-10 Hz.
    """

    C: Complexes
    partial_coherence: Floats
    multiple_coherence: Floats
    random_error: Floats
    Z: Complexes
    fit: SecondOrderFit
    weighted_fit: SecondOrderFit
    agreement: tuple[Agreement, ...]


@dataclass(frozen=True, slots=True)
class SpectralEstimate:
    """Everything [P] reports on a load.

    Attributes:
        frequency_Hz: shape (n_f,), positive, up to `upper_Hz`.
        band: the frequencies of the fit, boolean, shape (n_f,).
        setting: Welch segmentation.
        segments: averaged segments over all trials ([P]'s N_MNS times the trials).
        averages: independent averages they are worth.
        input_coherence: ordinary coherence between the two forces, shape (n_f,); zeros for one axis.
        direct: estimate from F to d.
        derived: estimate by way of F_delta, or None without it.
        T: from F_delta to F (N/N), shape (n_f, n, n), or None.
        R: from F_delta to d (m/N), shape (n_f, n, n), or None.
        zero_coherence_level: partial coherence that unrelated signals reach in 5 % of cases.
        checks: stationarity, normality and, with several trials, repeatability.
    """

    frequency_Hz: Floats
    band: np.ndarray[tuple[int], np.dtype[np.bool_]]
    setting: WelchSetting
    segments: int
    averages: float
    input_coherence: Floats
    direct: ResponseEstimate
    derived: ResponseEstimate | None
    T: Complexes | None
    R: Complexes | None
    zero_coherence_level: float
    checks: tuple[StationarityCheck | NormalityCheck | RepeatabilityCheck, ...]

    @property
    def best(self) -> ResponseEstimate:
        """The derived estimate where the perturbation is known, as in [P], else the direct one."""
        return self.direct if self.derived is None else self.derived

    def __str__(self) -> str:
        lines = [
            f"{self.segments} segments of {self.setting.n_window} samples, "
            f"worth {self.averages:.1f} independent averages"
        ]
        for name, response in (("direct", self.direct), ("derived", self.derived)):
            if response is not None:
                lines.append(f"{name} estimate, as published: {response.fit}")
                lines.append(f"{name} estimate, weighted by its noise: {response.weighted_fit}")
                lines += [f"  {a}" for a in response.agreement]
        lines += [str(check) for check in self.checks]
        return "\n".join(lines)


def estimate_spectral(
    trials: Sequence[TrialSignals],
    fs: float,
    setting: WelchSetting = FINE,
    *,
    expected: tuple[Floats, Floats, Floats] | None = None,
    fit_upper_Hz: float = FIT_UPPER_HZ,
    upper_Hz: float = UPPER_HZ,
    slope_covariance: Floats | None = None,
    surrogates: int = SURROGATES,
) -> SpectralEstimate:
    """Impedance of one load from one or more trials, whose spectra are averaged.

    Args:
        trials: trials of the same load; [P] evaluates each of its six alone (pass one) and shows their mean.
        fs: sampling rate, Hz. Give `setting.scaled(fs)` when it is not 500.
        setting: `FINE` or `SMOOTH`.
        expected: (M, B, K) known beforehand, as of a spring array; the agreement then is with that model.
        fit_upper_Hz: end of the band that the second-order model is fitted over.
        upper_Hz: highest frequency of the estimates; the perturbation should reach it.
        slope_covariance: of the parameters behind the trials' `force_slope`, shape (k, k).
        surrogates: how many stand behind the intervals of the published fit, in the best estimate; 0: none,
            and those are not numbers.

    Raises:
        UndeterminedError: no trials, trials shorter than one window, or inputs that cannot be told apart.
    """
    if not trials:
        raise UndeterminedError("no stochastic trials of this load")
    grid = np.arange(setting.n_fft // 2 + 1) * fs / setting.n_fft
    bins = np.flatnonzero((grid > 0) & (grid <= max(upper_Hz, fit_upper_Hz)))
    sampling = Sampling(fs, setting, bins)
    frequency = sampling.frequency_Hz
    lengths = [len(t.force) - 2 * MARGIN for t in trials]
    averages = sum(independent_averages(setting, length) for length in lengths)
    band = (frequency >= setting.resolution_Hz(fs) * (1 - 1e-9)) & (frequency <= fit_upper_Hz)
    records = _transforms(trials, sampling)
    edges = (float(frequency[band][0]), float(frequency[band][-1])) if np.any(band) else (0.0, 0.0)
    task = Task(sampling, edges, averages, _quiet(trials, sampling), slope_covariance)
    commanded = all(t.perturbation is not None for t in trials)
    direct = _response(task, records, "force", expected, 0 if commanded else surrogates)
    derived, T, R = None, None, None
    n = trials[0].force.shape[1]
    if commanded:
        derived = _response(task, records, "perturbation", expected, surrogates)
        p = [_given(record.p) for record in records]
        S_pp = pooled(p, p)
        R = direct_response(pooled([record.d for record in records], p), S_pp)
        T = direct_response(pooled([record.F for record in records], p), S_pp)
    return SpectralEstimate(
        frequency,
        band,
        setting,
        sum(setting.segments(length) for length in lengths),
        averages,
        _input_coherence(pooled([record.F for record in records], [record.F for record in records])),
        direct,
        derived,
        T,
        R,
        zero_coherence_level(averages, n),
        _checks(trials, fs),
    )


Instrument = Literal["force", "perturbation"]


@dataclass(frozen=True, slots=True)
class _Published:
    """What [P] computes from the spectra."""

    C: Complexes
    partial: Floats
    multiple: Floats
    Z: Complexes


def _transforms(trials: Sequence[TrialSignals], sampling: Sampling) -> list[Transforms]:
    return [transform_trial(t.force, t.displacement, t.perturbation, t.force_slope, sampling) for t in trials]


def _quiet(trials: Sequence[TrialSignals], sampling: Sampling) -> Quiet:
    """The trials through a Hann window as long as the shortest."""
    lengths = [len(t.force) - 2 * MARGIN for t in trials]
    half = min(lengths) // 2
    setting = WelchSetting(2 * half, 2 * half, half)
    grid = np.arange(1, half + 1)
    long = Sampling(sampling.fs, setting, grid[grid * sampling.fs / (2 * half) <= sampling.frequency_Hz[-1]])
    averages = sum(independent_averages(setting, length) for length in lengths)
    return Quiet(_transforms(trials, long), long, averages)


def _given(p: Complexes | None) -> Complexes:
    if p is None:
        raise ValueError("this estimate needs the perturbation of every trial")
    return p


def _instruments(records: Sequence[Transforms], which: Instrument) -> list[Complexes]:
    return [record.F if which == "force" else _given(record.p) for record in records]


def _published(frequency: Floats, records: Sequence[Transforms], which: Instrument) -> _Published:
    """C = S_dw S_Fw^-1 with instrument w, which is R T^-1 with the perturbation, and what follows."""
    w = _instruments(records, which)
    F, d = [record.F for record in records], [record.d for record in records]
    C = direct_response(pooled(d, w), pooled(F, w))
    S_dd, S_dF, S_FF = pooled(d, d), pooled(d, F), pooled(F, F)
    noise = noise_spectrum(direct_response(S_dF, S_FF), S_dd, S_dF, S_FF)
    partial = partial_coherence(C, S_FF, noise)
    return _Published(C, partial, multiple_coherence(C, S_FF, noise), impedance(frequency, C))


def _weighted(task: Task, records: Sequence[Transforms], which: Instrument) -> Loop:
    """The weighted fit, and what stands before the load, where the perturbation tells."""
    psi = projected(records, _instruments(records, which))
    if which == "force":
        return Loop(fit_weighted(records, psi, task), None)
    robot = solve([record.of_robot() for record in records], psi, task)
    psi = predicted(records, solve(records, psi, task), robot, task.sampling.reduced())
    return Loop(fit_weighted(records, psi, task), robot)


def _response(
    task: Task,
    records: Sequence[Transforms],
    which: Instrument,
    expected: tuple[Floats, Floats, Floats] | None,
    surrogates: int,
) -> ResponseEstimate:
    """Coherences, errors and both fits of one estimate."""
    f = task.sampling.frequency_Hz
    band = np.flatnonzero((f >= task.band[0]) & (f <= task.band[1]))
    published = _published(f, records, which)
    Z, partial = published.Z[band], published.partial
    frequency = f[band]
    fit = fit_second_order(frequency, Z, partial[band])
    loop = _weighted(task, records, which)
    if surrogates:

        def refit(again: Sequence[Transforms]) -> SecondOrderFit:
            part = _published(frequency, again, which)
            return fit_second_order(frequency, part.Z, part.partial)

        fit = with_intervals(
            fit,
            loop,
            [record.at(band) for record in records],
            refit,
            task.sampling.reduced().at(band),
            surrogates,
            task.slope_covariance,
        )
    model = fit.impedance(frequency) if expected is None else second_order_impedance(frequency, *expected)
    return ResponseEstimate(
        published.C,
        partial,
        published.multiple,
        random_error(partial, task.averages, published.C.shape[1]),
        Z,
        fit,
        loop.load.fit,
        tuple(agreement(frequency, Z, model, partial[band], upper) for upper in AGREEMENT_UPPER_HZ),
    )


def _input_coherence(S_FF: Complexes) -> Floats:
    """Ordinary coherence between the first two inputs: [P]'s measure of coupling by the interaction."""
    if S_FF.shape[1] < 2:
        return np.zeros(len(S_FF))
    power = (S_FF[:, 0, 0] * S_FF[:, 1, 1]).real
    return np.asarray(np.divide(np.abs(S_FF[:, 0, 1]) ** 2, power, out=np.zeros_like(power), where=power > 0))


def _checks(
    trials: Sequence[TrialSignals], fs: float
) -> tuple[StationarityCheck | NormalityCheck | RepeatabilityCheck, ...]:
    """Stationarity and normality of the force in every trial, repeatability of force and motion."""
    n = trials[0].force.shape[1]
    axes = ("x", "y", "z")[:n] if n <= 3 else tuple(str(i + 1) for i in range(n))
    samples = min(len(t.force) for t in trials)
    several = len(trials) > 1
    names = tuple(
        f"F_{a} of trial {k + 1}" if several else f"F_{a}" for k in range(len(trials)) for a in axes
    )
    forces = np.concatenate([t.force[:samples] for t in trials], axis=1)
    checks: list[StationarityCheck | NormalityCheck | RepeatabilityCheck] = [
        stationarity(forces, fs, names),
        normality(forces, fs, names),
    ]
    if several:
        both = tuple(np.concatenate([t.force, t.displacement], axis=1) for t in trials)
        commands = tuple(t.perturbation for t in trials if t.perturbation is not None)
        known = commands if len(commands) == len(trials) else None
        checks.append(repeatability(both, tuple(f"F_{a}" for a in axes) + axes, known))
    return tuple(checks)
