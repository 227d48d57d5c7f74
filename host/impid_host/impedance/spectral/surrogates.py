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

from impid_host.impedance.spectral.arrays import Complexes, Floats
from impid_host.impedance.spectral.loop import Spectrum, dynamic_stiffness
from impid_host.impedance.spectral.second_order import SecondOrderFit
from impid_host.impedance.spectral.transforms import Sampling, Transforms, segment_transforms
from impid_host.impedance.spectral.weighted_fit import WeightedFit
from impid_host.signals.quantiles import NORMAL_975, student_975

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
    plans = {samples: _Plan.of(samples, loop, sampling) for samples in {trial.samples for trial in trials}}
    found = np.array(
        [
            _vector(refit([_surrogate(rng, t, plans[t.samples], loop, sampling, shift) for t in trials]))
            for shift in _shifts(rng, slope_covariance, count)
        ]
    )
    # The surrogates' own mean is uncertain by 1 / count of their variance.
    widening = student_975(count - 1) / NORMAL_975 * np.sqrt(1 + 1 / count)
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


@dataclass(frozen=True, slots=True)
class _Plan:
    """What the surrogates of one trial share: (n_f, n, n) each but `top`, the first frequency left out.

    Attributes:
        root: square root of the power of the load's own force per DFT bin, N.
        load: dynamic stiffness of the load, N/m.
        compliance: of load and robot together, or of the load where the robot is unknown, m/N.
    """

    spectrum: Spectrum
    top: int
    root: Complexes
    load: Complexes
    compliance: Complexes

    @staticmethod
    def of(samples: int, loop: Loop, sampling: Sampling) -> "_Plan":
        spectrum = Spectrum.of(samples, sampling.fs)
        # Nothing is asked of frequencies far beyond the band.
        top = int(np.searchsorted(spectrum.f, 1.2 * sampling.frequency_Hz[-1]))
        value, vector = np.linalg.eigh(loop.load.residual.at(spectrum.f[:top]))
        # A one-sided density S gives DFT bins of power S fs n_fft / 2, half of it in either part.
        root = (
            vector * np.sqrt(np.clip(value, 0.0, None) * 0.25 * sampling.fs * spectrum.n_fft)[:, np.newaxis]
        )
        root[0] = 0.0
        load = dynamic_stiffness(loop.load.fit, spectrum.f)
        whole = load if loop.robot is None else load + dynamic_stiffness(loop.robot, spectrum.f)
        return _Plan(spectrum, top, root, load, np.asarray(np.linalg.inv(whole)))

    def own_force(self, rng: np.random.Generator) -> Complexes:
        """Of the load, beyond M, B and K, shape (n_f, n)."""
        z = rng.standard_normal((2, *self.root.shape[:2]))
        own = np.zeros((len(self.spectrum.f), self.root.shape[1]), dtype=np.complex128)
        own[: self.top] = _apply(self.root, z[0] + 1j * z[1])
        return own


def _apply(matrix: Complexes, vector: Complexes) -> Complexes:
    return np.asarray((matrix @ vector[:, :, np.newaxis])[:, :, 0])


def _surrogate(
    rng: np.random.Generator,
    trial: Transforms,
    plan: _Plan,
    loop: Loop,
    sampling: Sampling,
    shift: Floats | None,
) -> Transforms:
    own = plan.own_force(rng)
    fit = loop.load.fit
    drift = 0.0 if shift is None or trial.slope is None else segment_transforms(trial.slope @ shift, sampling)
    if trial.command is None or loop.robot is None:
        model = trial.d @ fit.K.T + trial.v @ fit.B.T + trial.a @ fit.M.T
        moved = segment_transforms(plan.spectrum.back(_apply(plan.compliance, own)), sampling)
        return replace(trial, F=model + drift, d=trial.d - moved)
    d = _apply(plan.compliance, plan.spectrum.forward(trial.command) - own)
    signals = plan.spectrum.back(np.concatenate([_apply(plan.load, d) + own, d], axis=1))
    both = segment_transforms(signals, sampling)
    n = d.shape[1]
    return replace(trial, F=both[:, :, :n] + drift, d=both[:, :, n:])
