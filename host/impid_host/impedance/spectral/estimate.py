"""From the signals of one or more force-perturbation trials to impedance, coherences, fit and checks.

The steps of [P] in their order; each step's algebra is in the file of its name.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.agreement import Agreement, agreement
from impid_host.impedance.spectral.arrays import Complexes, Floats
from impid_host.impedance.spectral.coherence import (
    multiple_coherence,
    partial_coherence,
    zero_coherence_level,
)
from impid_host.impedance.spectral.frequency_response import (
    derived_response,
    direct_response,
    impedance,
    noise_spectrum,
)
from impid_host.impedance.spectral.normality import NormalityCheck, normality
from impid_host.impedance.spectral.random_error import random_error
from impid_host.impedance.spectral.repeatability import RepeatabilityCheck, repeatability
from impid_host.impedance.spectral.second_order import (
    SecondOrderFit,
    fit_second_order,
    impedance_error_factor,
    second_order_impedance,
)
from impid_host.impedance.spectral.stationarity import StationarityCheck, stationarity
from impid_host.impedance.spectral.weighted_fit import CrossSpectra, fit_cross_spectra
from impid_host.impedance.spectral.welch import (
    FINE,
    WelchSetting,
    bin_correlation,
    cross_spectra,
    independent_averages,
)

FIT_UPPER_HZ = 10.0
# [P]'s perturbation ends at 15 Hz; far beyond, ratios of two nothings say nothing.
UPPER_HZ = 25.0
AGREEMENT_UPPER_HZ = (5.0, 10.0)


@dataclass(frozen=True, slots=True)
class TrialSignals:
    """One stochastic trial on a uniform grid.

    Attributes:
        force: F, force of the robot on the arm or load (N), shape (N, n): the negative of a study's
            fx, fy; from a force sensor or from the virtual one.
        displacement: d, position of the end-effector (m), shape (N, n).
        perturbation: F_delta, commanded perturbation (N), shape (N, n), or None where it was not logged.
    """

    force: Floats
    displacement: Floats
    perturbation: Floats | None = None

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


@dataclass(frozen=True, slots=True)
class _Spectra:
    """Pooled spectra of displacement, force and what the direct estimate leaves, (n_f, n, n) each."""

    dd: Complexes
    dF: Complexes
    FF: Complexes
    noise: Complexes


def estimate_spectral(
    trials: Sequence[TrialSignals],
    fs: float,
    setting: WelchSetting = FINE,
    *,
    expected: tuple[Floats, Floats, Floats] | None = None,
    fit_upper_Hz: float = FIT_UPPER_HZ,
    upper_Hz: float = UPPER_HZ,
) -> SpectralEstimate:
    """Impedance of one load from one or more trials, whose spectra are averaged.

    Args:
        trials: trials of the same load; [P] evaluates each of its six alone (pass one) and shows their mean.
        fs: sampling rate, Hz. Give `setting.scaled(fs)` when it is not 500.
        setting: `FINE` or `SMOOTH`.
        expected: (M, B, K) known beforehand, as of a spring array; the agreement then is with that model.
        fit_upper_Hz: end of the band that the second-order model is fitted over.
        upper_Hz: highest frequency of the estimates; the perturbation should reach it.

    Raises:
        UndeterminedError: no trials, trials shorter than one window, or inputs that cannot be told apart.
    """
    if not trials:
        raise UndeterminedError("no stochastic trials of this load")

    def pooled(a: str, b: str) -> Complexes:
        return _pooled(trials, (a, b), fs, setting)[kept]

    grid = np.arange(setting.n_fft // 2 + 1) * fs / setting.n_fft
    kept = (grid > 0) & (grid <= max(upper_Hz, fit_upper_Hz))
    frequency = grid[kept]
    S_dd, S_dF, S_FF = (
        pooled("displacement", "displacement"),
        pooled("displacement", "force"),
        pooled("force", "force"),
    )
    segments = sum(setting.segments(len(t.force)) for t in trials)
    averages = sum(independent_averages(setting, len(t.force)) for t in trials)
    band = (frequency >= setting.resolution_Hz(fs) * (1 - 1e-9)) & (frequency <= fit_upper_Hz)
    spacing = frequency[band][:, np.newaxis] - frequency[band]
    context = _Context(
        frequency, band, averages, bin_correlation(setting, len(trials[0].force), fs, spacing), expected
    )

    C = direct_response(S_dF, S_FF)
    spectra = _Spectra(S_dd, S_dF, S_FF, noise_spectrum(C, S_dd, S_dF, S_FF))
    direct = _response(context, spectra, C, _Instrument(S_dF, S_FF, S_FF))
    derived, T, R = None, None, None
    if all(t.perturbation is not None for t in trials):
        S_pp = pooled("perturbation", "perturbation")
        S_dp, S_Fp = pooled("displacement", "perturbation"), pooled("force", "perturbation")
        R, T = direct_response(S_dp, S_pp), direct_response(S_Fp, S_pp)
        derived = _response(context, spectra, derived_response(R, T), _Instrument(S_dp, S_Fp, S_pp))
    return SpectralEstimate(
        frequency,
        band,
        setting,
        segments,
        averages,
        _input_coherence(S_FF),
        direct,
        derived,
        T,
        R,
        zero_coherence_level(averages, S_FF.shape[1]),
        _checks(trials, fs),
    )


@dataclass(frozen=True, slots=True)
class _Instrument:
    """Cross-spectra of displacement and force with the instrument w, and its own, each shape (n_f, n, n)."""

    dw: Complexes
    Fw: Complexes
    ww: Complexes


@dataclass(frozen=True, slots=True)
class _Context:
    frequency: Floats
    band: np.ndarray[tuple[int], np.dtype[np.bool_]]
    averages: float
    correlation: Floats
    expected: tuple[Floats, Floats, Floats] | None


def _pooled(
    trials: Sequence[TrialSignals], signals: tuple[str, str], fs: float, setting: WelchSetting
) -> Complexes:
    """Cross-spectrum of two signals averaged over the trials, each weighted by its number of segments."""
    weights = np.array([setting.segments(len(trial.force)) for trial in trials], dtype=np.float64)
    spectra = [cross_spectra(getattr(t, signals[0]), getattr(t, signals[1]), fs, setting)[1] for t in trials]
    return np.asarray(np.tensordot(weights / weights.sum(), np.array(spectra), axes=1))


def _response(
    context: _Context, spectra: _Spectra, C: Complexes, instrument: _Instrument
) -> ResponseEstimate:
    """Coherences, errors and fit of C = S_dw S_Fw^-1 with instrument w."""
    n = C.shape[1]
    band, frequency = context.band, context.frequency[context.band]
    partial = partial_coherence(C, spectra.FF, spectra.noise)
    Z = impedance(frequency, C[band])
    degrees = max(context.averages - n, np.finfo(float).eps)
    S_Fd = np.conj(np.swapaxes(spectra.dF, 1, 2))
    residual = noise_spectrum(C[band], spectra.dd[band], spectra.dF[band], spectra.FF[band])
    left = _hermitian_root(residual) * np.sqrt(context.averages / degrees)
    S_dw, S_Fw, S_ww = instrument.dw[band], instrument.Fw[band], instrument.ww[band]
    right = _hermitian_root(S_ww) @ np.linalg.inv(S_Fw) / np.sqrt(context.averages)
    fit = fit_second_order(
        frequency,
        Z,
        partial[band],
        error_factor=impedance_error_factor(frequency, Z, left, right),
        error_correlation=context.correlation,
    )
    model = (
        fit.impedance(frequency)
        if context.expected is None
        else second_order_impedance(frequency, *context.expected)
    )
    return ResponseEstimate(
        C,
        partial,
        multiple_coherence(C, spectra.FF, spectra.noise),
        random_error(partial, context.averages, n),
        Z,
        fit,
        fit_cross_spectra(
            frequency,
            CrossSpectra(S_Fw, S_dw, S_ww, spectra.FF[band], S_Fd[band], spectra.dd[band]),
            context.averages,
            context.correlation,
        ),
        tuple(agreement(frequency, Z, model, partial[band], upper) for upper in AGREEMENT_UPPER_HZ),
    )


def _hermitian_root(S: Complexes) -> Complexes:
    """The Hermitian square root, which unlike a Cholesky factor varies smoothly where S becomes singular."""
    value, vector = np.linalg.eigh(S)
    root = np.sqrt(np.clip(value, 0.0, None))[:, np.newaxis, :]
    return np.asarray((vector * root) @ np.conj(np.swapaxes(vector, 1, 2)))


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
        checks.append(repeatability(both, tuple(f"F_{a}" for a in axes) + axes))
    return tuple(checks)
