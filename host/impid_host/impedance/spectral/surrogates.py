"""Bias and scatter of the published second-order fit, by repeating it on records whose answer is known.

The published fit is biased: the window smears the resonance, and a noisy gain in dB errs upwards. Both are
reproduced by surrogates: the perturbation that was commanded acts on a robot and a load with the parameters
of the weighted fit, a force with the spectrum of the measured residual acts as well, and the published fit
does with that record what it did with the measured one. Its mean less the parameters put in is its bias, its
scatter is its standard deviation. Without a known perturbation the measured motion stands in for it.

Source: B. Efron and R. J. Tibshirani, An Introduction to the Bootstrap, ch. 6 and 10 (parametric bootstrap).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.stats

from impid_host.impedance.spectral.arrays import Complexes, Floats
from impid_host.impedance.spectral.loop import Spectrum, displacement, dynamic_stiffness
from impid_host.impedance.spectral.second_order import SecondOrderFit
from impid_host.impedance.spectral.transforms import Sampling, Transforms, segment_transforms
from impid_host.impedance.spectral.weighted_fit import Density, WeightedFit

_SEED = 2007


@dataclass(frozen=True, slots=True)
class Loop:
    """What surrogates are made of: the load with its residual; robot and hold as M, B, K, or None."""

    load: WeightedFit
    robot: SecondOrderFit | None


def with_intervals(
    fit: SecondOrderFit,
    loop: Loop,
    trials: Sequence[Transforms],
    refit: Callable[[Sequence[Transforms]], SecondOrderFit],
    sampling: Sampling,
    count: int,
    slope_covariance: Floats | None = None,
) -> SecondOrderFit:
    """The published fit with bias and standard deviations from `count` surrogates.

    Args:
        fit: to be judged.
        loop: what the surrogates are made of.
        trials: transforms of the measured trials.
        refit: the published fit on transforms.
        sampling: of the transforms, reduced.
        count: surrogates; their finite number widens the standard deviations by Student's t.
        slope_covariance: (k, k), of the parameters behind `Transforms.slope`; drawn anew in each surrogate.
    """
    rng = np.random.default_rng(_SEED)
    found = np.array(
        [
            _vector(refit([_surrogate(rng, trial, loop, sampling, shift) for trial in trials]))
            for shift in _shifts(rng, slope_covariance, count)
        ]
    )
    # The surrogates' own mean is uncertain by 1 / count of their variance.
    widening = scipy.stats.t.ppf(0.975, count - 1) / scipy.stats.norm.ppf(0.975) * np.sqrt(1 + 1 / count)
    covariance = np.atleast_2d(np.cov(found, rowvar=False)) * widening**2
    shape = (3, *fit.M.shape)
    sd = np.sqrt(np.diag(covariance)).reshape(shape)
    bias = (found.mean(axis=0) - _vector(loop.load.fit)).reshape(shape)
    return replace(fit, M_sd=sd[0], B_sd=sd[1], K_sd=sd[2], covariance=covariance, bias=bias)


def _vector(fit: SecondOrderFit) -> Floats:
    return np.concatenate([fit.M.ravel(), fit.B.ravel(), fit.K.ravel()])


def _shifts(rng: np.random.Generator, covariance: Floats | None, count: int) -> list[Floats | None]:
    if covariance is None:
        return [None] * count
    return list(rng.multivariate_normal(np.zeros(len(covariance)), covariance, count, method="eigh"))


def _surrogate(
    rng: np.random.Generator, trial: Transforms, loop: Loop, sampling: Sampling, shift: Floats | None
) -> Transforms:
    spectrum = Spectrum.of(trial.samples, sampling.fs)
    # Nothing is asked of frequencies far beyond the band.
    top = int(np.searchsorted(spectrum.f, 1.2 * sampling.frequency_Hz[-1]))
    own = np.zeros((len(spectrum.f), trial.F.shape[2]), dtype=np.complex128)
    own[1:top] = _noise(rng, loop.load.residual, spectrum.f[1:top], spectrum.n_fft * sampling.fs)
    fit = loop.load.fit
    load = dynamic_stiffness(fit, spectrum.f)

    def windowed(signal: Complexes) -> Complexes:
        return segment_transforms(spectrum.back(signal), sampling)

    drift = 0.0 if shift is None or trial.slope is None else segment_transforms(trial.slope @ shift, sampling)
    if trial.command is None or loop.robot is None:
        model = trial.d @ fit.K.T + trial.v @ fit.B.T + trial.a @ fit.M.T
        return replace(trial, F=model + drift, d=trial.d - windowed(displacement(load, own)))
    p = spectrum.forward(trial.command)
    d = displacement(load + dynamic_stiffness(loop.robot, spectrum.f), p - own)
    F = np.einsum("fij,fj->fi", load, d) + own
    return replace(trial, F=windowed(F) + drift, d=windowed(d), p=windowed(p))


def _noise(rng: np.random.Generator, density: Density, f: Floats, fs_n: float) -> Complexes:
    """DFT bins of Gaussian noise with the one-sided density, whose power is S fs n / 2, shape (n_f, n)."""
    S = density.at(f)
    value, vector = np.linalg.eigh(S)
    root = vector * np.sqrt(np.clip(value, 0.0, None))[:, np.newaxis, :]
    z = rng.standard_normal((2, *S.shape[:2])) * np.sqrt(0.25 * fs_n)
    return np.asarray(np.einsum("fij,fj->fi", root, z[0] + 1j * z[1]))
