from dataclasses import replace

import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.estimate import TrialSignals, estimate_spectral
from impid_host.impedance.spectral.welch import FINE, SMOOTH, WelchSetting

ROBOT = {"M": np.array([[1.0, 0.15], [0.15, 1.3]]), "B": 2.0 * np.eye(2), "K": 40.0 * np.eye(2)}


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("setting", [FINE, SMOOTH, WelchSetting(1024, 512, 256)])
def test_noise_free_records_give_exact_parameters_whatever_the_window(truth, n, setting):
    """No leakage: a 1 s window holds less than two cycles of the resonance and is as good as one of 16 s."""
    rng = np.random.default_rng(n)
    M, B, K = (s * (np.eye(n) + 0.2 * rng.standard_normal((n, n))) for s in (1.0, 3.0, 150.0))
    p = truth.coloured(rng, 25000, n)
    d = truth.respond(lambda w: np.linalg.inv(truth.dynamic_stiffness(w, M, B, K) + 50 * np.eye(n)), p)
    trial = TrialSignals(p - 50 * d, d, p)
    fit = estimate_spectral([trial], truth.FS, setting, surrogates=0).derived.weighted_fit
    np.testing.assert_allclose(fit.M, M, atol=2e-5)
    np.testing.assert_allclose(fit.B, B, atol=2e-4)
    np.testing.assert_allclose(fit.K, K, atol=5e-3)


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


@pytest.mark.parametrize("setting", [FINE, SMOOTH])
def test_all_twelve_parameters_are_unbiased_and_sharper_than_as_published(truth, setting):
    rng = np.random.default_rng(21)
    true = np.concatenate([truth.arm.M.ravel(), truth.arm.B.ravel(), truth.arm.K.ravel()])
    z, ratio = [], []
    for _ in range(12):
        trials = [_trial(truth, rng, 0.5) for _ in range(3)]
        response = estimate_spectral(trials, truth.FS, setting, surrogates=12).derived
        z.append((_vector(response.weighted_fit) - true) / _vector(response.weighted_fit, "_sd"))
        ratio.append(_vector(response.weighted_fit, "_sd") / _vector(response.fit, "_sd"))
    # 144 values: errors as large as stated, and no parameter's mean off by its own deviation
    assert 0.8 < np.sqrt(np.mean(np.square(z))) < 1.2
    assert np.max(np.abs(np.mean(z, axis=0))) < 1.0
    assert np.all(np.mean(ratio, axis=0) < 1.0)
    assert np.mean(np.array(ratio)[:, :8]) < 0.5


def test_two_frequencies_are_too_few(truth):
    trial = _trial(truth, np.random.default_rng(1), 0.1)
    with pytest.raises(UndeterminedError, match="fewer than three"):
        estimate_spectral([trial], truth.FS, FINE, fit_upper_Hz=0.13)


def test_uncertainty_of_the_robot_behind_a_virtual_force_is_in_the_intervals(truth):
    """Force in error by c a, c drawn once a study: M_xx is in error by c, and its interval must say so."""
    rng = np.random.default_rng(31)
    sd = 0.05
    z = []
    for _ in range(30):
        clean = _trial(truth, rng, 0.1)
        slope = np.zeros((25000, 2, 1))
        slope[:, 0, 0] = np.gradient(np.gradient(clean.displacement[:, 0], 1 / truth.FS), 1 / truth.FS)
        wrong = replace(
            clean, force=clean.force + slope[:, :, 0] * sd * rng.standard_normal(), force_slope=slope
        )
        fit = estimate_spectral(
            [wrong], truth.FS, FINE, slope_covariance=np.array([[sd**2]]), surrogates=0
        ).derived.weighted_fit
        assert fit.M_sd[0, 0] == pytest.approx(sd, rel=0.02)
        assert fit.M_sd[1, 1] < 0.1 * sd
        z.append((fit.M[0, 0] - truth.arm.M[0, 0]) / fit.M_sd[0, 0])
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.3
