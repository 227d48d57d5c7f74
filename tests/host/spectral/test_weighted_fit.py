import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.estimate import TrialSignals, estimate_spectral
from impid_host.impedance.spectral.weighted_fit import CrossSpectra, fit_cross_spectra
from impid_host.impedance.spectral.welch import FINE, SMOOTH

FREQUENCY = np.arange(0.1, 10, 0.1)
ROBOT = {"M": np.array([[1.0, 0.15], [0.15, 1.3]]), "B": 2.0 * np.eye(2), "K": 40.0 * np.eye(2)}


def _adjoint(S):
    return np.conj(np.swapaxes(S, 1, 2))


@pytest.mark.parametrize("n", [1, 2, 3])
def test_exact_spectra_give_exact_parameters(truth, n):
    rng = np.random.default_rng(n)
    M, B, K = (s * (np.eye(n) + 0.2 * rng.standard_normal((n, n))) for s in (1.0, 8.0, 150.0))
    D = truth.dynamic_stiffness(2 * np.pi * FREQUENCY, M, B, K)
    G = rng.standard_normal((len(FREQUENCY), n, n)) + 1j * rng.standard_normal((len(FREQUENCY), n, n))
    ww = G @ _adjoint(G)
    dw = np.linalg.inv(D + 50 * np.eye(n)) @ ww
    dd = dw @ np.linalg.inv(ww) @ _adjoint(dw)
    spectra = CrossSpectra(D @ dw, dw, ww, D @ dd @ _adjoint(D), D @ dd, dd)
    fit = fit_cross_spectra(FREQUENCY, spectra, 10.0, np.eye(len(FREQUENCY)))
    np.testing.assert_allclose(fit.M, M, atol=1e-8)
    np.testing.assert_allclose(fit.B, B, atol=1e-7)
    np.testing.assert_allclose(fit.K, K, atol=1e-6)


def _trial(truth, rng, voluntary):
    arm = truth.arm

    def load(w):
        return truth.dynamic_stiffness(w, arm.M, arm.B, arm.K)

    def both(w):
        return np.linalg.inv(load(w) + truth.dynamic_stiffness(w, **ROBOT))

    perturbation = truth.coloured(rng, 25000, 2)
    own = truth.coloured(rng, 25000, 2, cutoff_Hz=3.0, rms=voluntary)
    d = truth.respond(both, perturbation + own)
    return TrialSignals(truth.respond(lambda w: load(w) @ both(w), perturbation + own) - own, d, perturbation)


def _vector(fit, suffix=""):
    return np.concatenate([getattr(fit, name + suffix).ravel() for name in "MBK"])


# The short window smears the noise, which ends sharply at 3 Hz, over coherent frequencies: its intervals err
# wide.
@pytest.mark.parametrize(("setting", "lowest_rms"), [(FINE, 0.8), (SMOOTH, 0.5)])
def test_all_twelve_parameters_are_unbiased_and_sharper_than_as_published(truth, setting, lowest_rms):
    rng = np.random.default_rng(21)
    true = np.concatenate([truth.arm.M.ravel(), truth.arm.B.ravel(), truth.arm.K.ravel()])
    z, ratio = [], []
    for _ in range(12):
        trials = [_trial(truth, rng, 0.5) for _ in range(3)]
        response = estimate_spectral(trials, truth.FS, setting).derived
        z.append((_vector(response.weighted_fit) - true) / _vector(response.weighted_fit, "_sd"))
        ratio.append(_vector(response.weighted_fit, "_sd") / _vector(response.fit, "_sd"))
    z = np.array(z)
    # 144 values: errors as large as stated, and no parameter's mean off by its own deviation
    assert lowest_rms < np.sqrt(np.mean(z**2)) < 1.2
    assert np.max(np.abs(z.mean(axis=0))) < 1.0
    assert np.all(np.mean(ratio, axis=0) < 1.0)
    assert np.mean(np.array(ratio)[:, :8]) < 0.5


def test_two_frequencies_are_too_few():
    S = np.ones((2, 1, 1), dtype=complex)
    with pytest.raises(UndeterminedError, match="fewer than three"):
        fit_cross_spectra(FREQUENCY[:2], CrossSpectra(S, S, S, S, S, S), 5.0, np.eye(2))
