import numpy as np
import pytest
import scipy.signal
from impid_host.impedance.spectral.coherence import (
    conditioned_input_power,
    multiple_coherence,
    partial_coherence,
    zero_coherence_level,
)
from impid_host.impedance.spectral.frequency_response import direct_response, noise_spectrum
from impid_host.impedance.spectral.random_error import random_error
from impid_host.impedance.spectral.transforms import cross_spectra
from impid_host.impedance.spectral.welch import WelchSetting, independent_averages

SETTING = WelchSetting(256, 256, 128)


def _spectra(u, y, fs):
    S_uu = cross_spectra(u, u, fs, SETTING)[1]
    S_yu = cross_spectra(y, u, fs, SETTING)[1]
    S_yy = cross_spectra(y, y, fs, SETTING)[1]
    H = direct_response(S_yu, S_uu)
    return H, S_uu, noise_spectrum(H, S_yy, S_yu, S_uu)


def _related(rng, inputs, outputs, samples=6000):
    u = rng.standard_normal((samples, inputs)) @ (
        np.eye(inputs) + 0.5 * rng.standard_normal((inputs, inputs))
    )
    return u, u @ rng.standard_normal((inputs, outputs)) + 2 * rng.standard_normal((samples, outputs))


def test_single_input_is_the_ordinary_coherence_of_scipy(truth):
    u, y = _related(np.random.default_rng(1), 1, 1)
    H, S_uu, noise = _spectra(u, y, truth.FS)
    _, expected = scipy.signal.coherence(u[:, 0], y[:, 0], fs=truth.FS, nperseg=256, noverlap=128)
    np.testing.assert_allclose(partial_coherence(H, S_uu, noise)[1:, 0, 0], expected[1:], rtol=1e-8)
    np.testing.assert_allclose(multiple_coherence(H, S_uu, noise)[1:, 0], expected[1:], rtol=1e-8)


@pytest.mark.parametrize(("inputs", "outputs"), [(2, 2), (3, 2), (4, 1)])
def test_partial_coherence_is_the_coherence_of_regression_residuals(truth, inputs, outputs):
    u, y = _related(np.random.default_rng(2), inputs, outputs)
    H, S_uu, noise = _spectra(u, y, truth.FS)
    partial = partial_coherence(H, S_uu, noise)
    U, Y = truth.segment_spectra(u, SETTING), truth.segment_spectra(y, SETTING)
    for f in (3, 40, 100):
        for j in range(inputs):
            rest = np.delete(U[:, f], j, axis=1)
            u_left = U[:, f, j] - rest @ np.linalg.lstsq(rest, U[:, f, j], rcond=None)[0]
            for i in range(outputs):
                y_left = Y[:, f, i] - rest @ np.linalg.lstsq(rest, Y[:, f, i], rcond=None)[0]
                expected = (
                    abs(np.vdot(u_left, y_left)) ** 2
                    / (np.vdot(u_left, u_left) * np.vdot(y_left, y_left)).real
                )
                assert partial[f, i, j] == pytest.approx(expected, rel=1e-8)


def test_multiple_coherence_is_the_explained_share_of_a_regression(truth):
    u, y = _related(np.random.default_rng(3), 3, 2)
    H, S_uu, noise = _spectra(u, y, truth.FS)
    multiple = multiple_coherence(H, S_uu, noise)
    U, Y = truth.segment_spectra(u, SETTING), truth.segment_spectra(y, SETTING)
    for f in (3, 40, 100):
        fitted = U[:, f] @ np.linalg.lstsq(U[:, f], Y[:, f], rcond=None)[0]
        expected = np.sum(np.abs(fitted) ** 2, axis=0) / np.sum(np.abs(Y[:, f]) ** 2, axis=0)
        np.testing.assert_allclose(multiple[f], expected, rtol=1e-8)


def test_conditioned_power_is_the_reciprocal_of_the_inverse_spectrum(truth):
    u, _ = _related(np.random.default_rng(4), 3, 1)
    S_uu = cross_spectra(u, u, truth.FS, SETTING)[1]
    expected = 1 / np.diagonal(np.linalg.inv(S_uu), axis1=1, axis2=2).real
    np.testing.assert_allclose(conditioned_input_power(S_uu)[1:], expected[1:], rtol=1e-8)


def test_noise_free_system_is_fully_coherent_and_unrelated_signals_stay_at_chance(truth):
    rng = np.random.default_rng(5)
    u = rng.standard_normal((100_000, 2))
    H, S_uu, noise = _spectra(u, u @ np.array([[1.0, 2.0], [-0.5, 1.0]]), truth.FS)
    assert np.all(1 - partial_coherence(H, S_uu, noise)[1:] < 1e-9)
    H, S_uu, noise = _spectra(u, rng.standard_normal((100_000, 2)), truth.FS)
    partial = partial_coherence(H, S_uu, noise)[2:-2]
    averages = independent_averages(SETTING, 100_000)
    assert np.mean(partial < zero_coherence_level(averages, 2)) == pytest.approx(0.95, abs=0.03)


def test_scatter_of_the_response_is_the_random_error(truth):
    # y = u1 + 0.5 u2 + e, flat: partial coherences 1 / (1 + s^2) and 0.25 / (0.25 + s^2)
    rng = np.random.default_rng(6)
    gain, s = np.array([1.0, 0.5]), 0.7
    H = []
    for _ in range(300):
        u = rng.standard_normal((4000, 2))
        y = (u @ gain + s * rng.standard_normal(4000))[:, np.newaxis]
        H.append(_spectra(u, y, truth.FS)[0][5:100:3, 0, :])
    scatter = (
        np.sqrt(np.mean(np.abs(np.array(H)) ** 2 - np.abs(np.mean(H, axis=0)) ** 2, axis=(0, 1)) / 2) / gain
    )
    gamma2 = gain**2 / (gain**2 + s**2)
    averages = independent_averages(SETTING, 4000)
    np.testing.assert_allclose(scatter, random_error(gamma2, averages, 2), rtol=0.05)


def test_random_error_has_the_published_ratio_between_the_settings():
    # [P]: from 5 to 45 averages the error falls by 70 %
    ratio = random_error(np.array(0.9), 45, 2) / random_error(np.array(0.9), 5, 2)
    assert 1 - ratio == pytest.approx(0.70, abs=0.005)
    assert random_error(np.array(0.5), 3, 2) == pytest.approx(0.5)


def test_without_averages_nothing_is_known():
    assert zero_coherence_level(2.0, 2) == 1.0
    assert np.all(np.isinf(random_error(np.array([0.5, 1.0]), 1.0, 2)))
