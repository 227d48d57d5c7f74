"""M, B and K by instrumental variables, each frequency weighted by its own noise.

[P]'s fit in dB and degrees is kept as published (`second_order`), but it has a price: where an element of Z
passes through zero its noisy gain in dB errs upwards, inverting C smears resonances through the window, and
every coherent frequency counts alike however much power it holds. The equation of motion is linear in M, B
and K,

    F = K d + B v + M a + e,

in every windowed segment, without leakage when v and a are differentiated before the window (`transforms`).
Solved against an instrument, what the perturbation predicts of d, v and a, it has none of the three troubles,
and e may move d within the hold loop.

The solution is a weighted sum of the force's samples, so its variance follows from those weights and the
residual's spectrum, whatever segments overlap and frequencies share.

Source: R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, ch. 9; P. C. Young,
Recursive Estimation and Time-Series Analysis, ch. 7 (instruments from the model's own prediction).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.ndimage

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.arrays import Complexes, Floats
from impid_host.impedance.spectral.loop import Spectrum, displacement, dynamic_stiffness
from impid_host.impedance.spectral.second_order import SecondOrderFit
from impid_host.impedance.spectral.transforms import (
    Bins,
    Sampling,
    Transforms,
    pooled,
    segment_transforms,
    time_weights,
)

REWEIGHTINGS = 5
# A variance from few averages, used as a weight, prefers frequencies that are quiet by chance.
WEIGHT_AVERAGES = 40.0
# The variance sums the residual's spectrum over many frequencies, so there resolution counts for more.
VARIANCE_AVERAGES = 12.0


@dataclass(frozen=True, slots=True)
class Density:
    """A one-sided spectral density of forces: value (N^2/Hz), shape (n_f, n, n), at frequency_Hz, (n_f,)."""

    frequency_Hz: Floats
    value: Complexes

    def at(self, f: Floats) -> Complexes:
        """On other frequencies (m,), constant beyond the ends: shape (m, n, n)."""
        flat = self.value.reshape(len(self.frequency_Hz), -1)
        columns = [
            np.interp(f, self.frequency_Hz, x.real) + 1j * np.interp(f, self.frequency_Hz, x.imag)
            for x in flat.T
        ]
        return np.asarray(np.stack(columns, axis=1).reshape(len(f), *self.value.shape[1:]))


@dataclass(frozen=True, slots=True)
class WeightedFit:
    """The fit, whose `cost` is the weighted squared residual, and the density of F - M a - B v - K d."""

    fit: SecondOrderFit
    residual: Density


@dataclass(frozen=True, slots=True)
class Quiet:
    """The same trials through a window as long as the shortest of them, to show the residual's own spectrum.

    The estimate's window may be much shorter and smear noise over frequencies that have none.
    """

    trials: Sequence[Transforms]
    sampling: Sampling
    averages: float


@dataclass(frozen=True, slots=True)
class Task:
    """What the fits of one load have in common.

    Attributes:
        sampling: of the transforms.
        band: lowest and highest frequency that count, Hz.
        averages: independent averages behind the spectra.
        quiet: the trials through a long window.
        slope_covariance: (k, k) of the parameters behind `Transforms.slope`, or None.
    """

    sampling: Sampling
    band: tuple[float, float]
    averages: float
    quiet: Quiet
    slope_covariance: Floats | None

    @property
    def lines(self) -> Bins:
        """Where in the bins the fit looks: zero padding between the window's own lines tells nothing new."""
        f = self.sampling.frequency_Hz
        own = self.sampling.bins % self.padding == 0
        return np.flatnonzero(own & (f >= self.band[0] * (1 - 1e-9)) & (f <= self.band[1]))

    @property
    def padding(self) -> int:
        """How many bins lie on one line of the window."""
        return max(1, self.sampling.setting.n_fft // self.sampling.setting.n_window)


def projected(trials: Sequence[Transforms], w: Sequence[Complexes]) -> list[Complexes]:
    """What the instruments w (S, n_f, n) predict of (d, v, a), frequency by frequency: (S, n_f, 3 n) each."""
    motion = [_motion(trial) for trial in trials]
    gain = np.swapaxes(
        np.linalg.solve(np.swapaxes(pooled(w, w), 1, 2), np.swapaxes(pooled(motion, w), 1, 2)), 1, 2
    )
    return [np.einsum("fij,sfj->sfi", gain, part) for part in w]


def predicted(
    trials: Sequence[Transforms], load: SecondOrderFit, robot: SecondOrderFit, slower: Sampling
) -> list[Complexes]:
    """What robot and load as linear systems make of the perturbation: (d, v, a), (S, n_f, 3 n) each.

    Frequency by frequency the projection has as many free numbers as a short record has averages, and keeps a
    share of the noise that it should leave out; the model has few.
    """
    out = []
    for trial in trials:
        if trial.command is None:
            raise ValueError("a prediction needs the perturbation")
        spectrum = Spectrum.of(trial.samples, slower.fs)
        stiffness = dynamic_stiffness(load, spectrum.f) + dynamic_stiffness(robot, spectrum.f)
        d = displacement(stiffness, spectrum.forward(trial.command))
        jw = 2j * np.pi * spectrum.f[:, np.newaxis]
        motion = np.concatenate([spectrum.back(x) for x in (d, jw * d, jw**2 * d)], axis=1)
        out.append(segment_transforms(motion, slower))
    return out


def fit_weighted(trials: Sequence[Transforms], instruments: Sequence[Complexes], task: Task) -> WeightedFit:
    """M, B and K, full matrices, with standard deviations.

    Args:
        trials: transforms of every trial.
        instruments: by `projected` or `predicted`.
        task: band, averages and the like.

    Raises:
        UndeterminedError: fewer than three frequencies in the band.
    """
    lines = task.lines
    if len(lines) < 3:
        raise UndeterminedError("fewer than three frequencies in the band: M, B and K cannot be told apart")
    parameters, variance = _solve(trials, instruments, task)
    residual = Density(
        task.quiet.sampling.frequency_Hz,
        _residual_spectrum(_joint(task.quiet.trials), parameters, VARIANCE_AVERAGES / task.quiet.averages),
    )
    covariance = _covariance(trials, instruments, variance, residual, task)
    n = len(parameters)
    sd = np.sqrt(np.clip(np.diag(covariance), 0.0, None)).reshape(3, n, n)
    K, B, M = np.moveaxis(parameters.reshape(n, 3, n), 1, 0)
    own = np.diagonal(_residual_spectrum(_joint(trials), parameters, 1.0)[lines], axis1=1, axis2=2).real
    cost = task.averages * float(np.sum(own / variance))
    edges = task.sampling.frequency_Hz[lines[[0, -1]]]
    return WeightedFit(
        SecondOrderFit(
            M,
            B,
            K,
            sd[0],
            sd[1],
            sd[2],
            covariance,
            cost,
            (float(edges[0]), float(edges[1])),
            np.zeros((3, n, n)),
        ),
        residual,
    )


def solve(trials: Sequence[Transforms], instruments: Sequence[Complexes], task: Task) -> SecondOrderFit:
    """M, B and K alone, without their uncertainty."""
    parameters, _ = _solve(trials, instruments, task)
    n = len(parameters)
    K, B, M = np.moveaxis(parameters.reshape(n, 3, n), 1, 0)
    unknown = np.full((n, n), np.nan)
    return SecondOrderFit(M, B, K, unknown, unknown, unknown, None, np.nan, task.band, np.zeros((3, n, n)))


def _solve(
    trials: Sequence[Transforms], instruments: Sequence[Complexes], task: Task
) -> tuple[Floats, Floats]:
    """(K, B, M) row by row, shape (n, 3 n), and the residual's density at the lines, shape (n_lines, n)."""
    lines = task.lines
    joint = _joint(trials)
    power = np.diagonal(joint, axis1=1, axis2=2).real
    n = trials[0].F.shape[2]
    motion, psi = [_motion(trial)[:, lines] for trial in trials], [part[:, lines] for part in instruments]
    left = np.swapaxes(pooled(motion, psi), 1, 2)
    right = np.swapaxes(pooled([trial.F[:, lines] for trial in trials], psi), 1, 2)
    # Columns differ by powers of w: scaled, the solution keeps all digits.
    size = np.sqrt(np.mean(power[lines, n:], axis=0))
    floor = 1e-20 * power[:, :n]
    variance = np.maximum(power[:, :n], np.finfo(float).tiny)
    parameters = np.zeros((n, 3 * n))
    for _ in range(REWEIGHTINGS):
        for i in range(n):
            G = np.einsum("fkl,f->kl", left, 1.0 / variance[lines, i]).real / np.outer(size, size)
            b = np.einsum("fk,f->k", right[:, :, i], 1.0 / variance[lines, i]).real / size
            parameters[i] = np.linalg.solve(G, b) / size
        S = _residual_spectrum(joint, parameters, task.padding * WEIGHT_AVERAGES / task.averages)
        # A noise-free record must not divide by zero; what lies this far below the force is rounding.
        variance = np.maximum(np.diagonal(S, axis1=1, axis2=2).real, floor)
    return parameters, variance[lines]


def _motion(trial: Transforms) -> Complexes:
    return np.concatenate([trial.d, trial.v, trial.a], axis=2)


def _joint(trials: Sequence[Transforms]) -> Complexes:
    """Spectra of force, displacement, velocity and acceleration together, shape (n_f, 4 n, 4 n)."""
    together = [np.concatenate([trial.F, _motion(trial)], axis=2) for trial in trials]
    return pooled(together, together)


def _residual_spectrum(joint: Complexes, parameters: Floats, wide: float) -> Complexes:
    """Spectrum of F - K d - B v - M a, shape (n_f, n, n), mean over `wide` frequencies."""
    left = np.concatenate([np.eye(len(parameters)), -parameters], axis=1)
    S = left @ joint @ left.T
    if round(wide) < 2:
        return np.asarray(S)
    parts = [scipy.ndimage.uniform_filter1d(x, round(wide), axis=0, mode="nearest") for x in (S.real, S.imag)]
    return np.asarray(parts[0] + 1j * parts[1])


def _covariance(
    trials: Sequence[Transforms],
    instruments: Sequence[Complexes],
    variance: Floats,
    residual: Density,
    task: Task,
) -> Floats:
    """Covariance (3 n^2, 3 n^2) of (M, B, K), each row by row."""
    lines, slower = task.lines, task.sampling.reduced()
    n = variance.shape[1]
    psi = [part[:, lines] for part in instruments]
    left = np.swapaxes(pooled([_motion(trial)[:, lines] for trial in trials], psi), 1, 2)
    segments = sum(len(part) for part in psi)
    size = np.sqrt(np.abs(np.einsum("fkk->k", left).real))
    inverse = np.zeros((n, 3 * n, 3 * n))
    for i in range(n):
        G = np.einsum("fkl,f->kl", left, 1.0 / variance[:, i]).real / np.outer(size, size)
        inverse[i] = np.linalg.inv(G) / np.outer(size, size)
    output = np.tile(np.repeat(np.arange(n), n), 3)
    covariance = np.zeros((3 * n * n, 3 * n * n))
    gain = np.zeros((3 * n * n, 0 if trials[0].slope is None else trials[0].slope.shape[2]))
    for trial, part in zip(trials, psi, strict=True):
        # theta = G^-1 2 / segments Re sum_s,f conj(psi) F / variance; rows K, B, M become M, B, K
        c = np.einsum("ikl,sfl,fi->kisf", inverse, np.conj(part), 1.0 / variance) * (2.0 / segments)
        c = np.moveaxis(c.reshape(3, n, n, *c.shape[2:])[::-1], 1, 2).reshape(3 * n * n, *c.shape[2:])
        g = time_weights(c, slower.at(lines), trial.samples)
        covariance += _variance_of_sums(g, output, residual, slower)
        if trial.slope is not None:
            gain = gain + np.einsum("qt,tqk->qk", g, trial.slope[:, output])
    if task.slope_covariance is not None:
        covariance = covariance + gain @ task.slope_covariance @ gain.T
    return covariance


def _variance_of_sums(g: Floats, output: Bins, residual: Density, sampling: Sampling) -> Floats:
    """Covariance of sum_t g_q(t) e_output[q](t), e stationary with the density `residual`, shape (q, q)."""
    n_fft = 2 ** int(np.ceil(np.log2(g.shape[1])))
    f = np.arange(n_fft // 2 + 1) * sampling.fs / n_fft
    # The weights hold nothing beyond the band but what the window spills.
    top = int(np.searchsorted(f, 1.2 * sampling.frequency_Hz[-1]))
    G = np.fft.rfft(g, n_fft, axis=1)[:, :top]
    own = residual.at(f[:top])[:, output[:, np.newaxis], output]
    return np.asarray(
        (sampling.fs / n_fft) * np.einsum("pf,fpq,qf->pq", np.conj(G), own, G, optimize=True).real
    )
