import numpy as np
import pytest
import scipy.signal
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.transforms import (
    Sampling,
    cross_spectra,
    segment_transforms,
    time_weights,
)
from impid_host.impedance.spectral.welch import (
    FINE,
    SMOOTH,
    WelchSetting,
    independent_averages,
)


def test_published_settings_give_the_published_segments_and_resolutions():
    assert FINE.segments(25000) == 5
    assert SMOOTH.segments(25000) == 45
    assert FINE.resolution_Hz(500.0) == pytest.approx(0.061, abs=5e-4)
    assert SMOOTH.resolution_Hz(500.0) == pytest.approx(0.244, abs=5e-4)


@pytest.mark.parametrize(
    "setting", [WelchSetting(256, 256, 128), WelchSetting(512, 128, 96), WelchSetting(255, 101, 0)]
)
def test_spectra_are_the_average_of_segment_products(truth, setting):
    rng = np.random.default_rng(1)
    a, b = rng.standard_normal((2000, 3)), rng.standard_normal((2000, 2))
    frequency, S = cross_spectra(a, b, truth.FS, setting)
    A, B = truth.segment_spectra(a, setting), truth.segment_spectra(b, setting)
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(setting.n_window) / setting.n_window)
    expected = np.einsum("sfi,sfj->fij", A, B.conj()) / len(A) / (truth.FS * np.sum(window**2))
    last = None if setting.n_fft % 2 else -1
    expected[1:last] *= 2
    assert frequency == pytest.approx(np.fft.rfftfreq(setting.n_fft, 1 / truth.FS))
    np.testing.assert_allclose(S, expected, rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("setting", [WelchSetting(256, 256, 128), WelchSetting(512, 128, 96)])
def test_spectra_are_those_of_scipy(truth, setting):
    x = np.random.default_rng(4).standard_normal((3000, 2))
    _, S = cross_spectra(x, x, truth.FS, setting)
    for i in range(2):
        for j in range(2):
            _, reference = scipy.signal.csd(
                x[:, j], x[:, i], truth.FS, "hann", setting.n_window, setting.n_overlap, setting.n_fft
            )
            np.testing.assert_allclose(S[:, i, j], reference, rtol=1e-9, atol=1e-14)


def test_a_sum_over_transforms_is_a_weighted_sum_of_samples(truth):
    rng = np.random.default_rng(5)
    sampling = Sampling(truth.FS, WelchSetting(512, 128, 96), np.arange(3, 40))
    x = rng.standard_normal((1000, 1))
    X = segment_transforms(x, sampling)[:, :, 0]
    c = rng.standard_normal((2, *X.shape)) + 1j * rng.standard_normal((2, *X.shape))
    direct = np.einsum("qsf,sf->q", c, X).real
    np.testing.assert_allclose(time_weights(c, sampling, 1000) @ x[:, 0], direct, rtol=1e-9)


def test_slow_signals_have_the_same_transforms_at_the_reduced_rate(truth):
    sampling = Sampling(truth.FS, WelchSetting(8192, 2048, 1536), np.arange(12, 400))
    slower = sampling.reduced()
    assert slower.fs == 62.5
    t = np.arange(25000) / truth.FS
    x = np.stack([np.sin(2 * np.pi * f * t + f) for f in (0.7, 8.3, 23.0)], axis=1)
    full, slow = segment_transforms(x, sampling), segment_transforms(x[::8], slower)
    np.testing.assert_allclose(slow, full, atol=2e-4 * np.abs(full).max())


def test_power_of_a_signal_is_the_integral_of_its_spectrum(truth):
    x = np.random.default_rng(2).standard_normal((200_000, 1))
    frequency, S = cross_spectra(x, x, truth.FS, SMOOTH)
    assert np.trapezoid(S[:, 0, 0].real, frequency) == pytest.approx(x.var(), rel=0.01)


def test_independent_averages_of_long_records_reach_the_closed_form():
    # Hann: the correlation of windows half a length apart is 1/6, of a quarter, half, three quarters
    # 0.6592, 1/6, 0.00755: from the integral of the product of two shifted raised cosines.
    half = WelchSetting(1024, 1024, 512)
    assert independent_averages(half, 1024 * 2000) / half.segments(1024 * 2000) == pytest.approx(
        18 / 19, rel=1e-3
    )
    quarter = WelchSetting(1024, 1024, 768)
    expected = 1 / (1 + 2 * (0.65915**2 + (1 / 6) ** 2 + 0.00755**2))
    assert independent_averages(quarter, 1024 * 2000) / quarter.segments(1024 * 2000) == pytest.approx(
        expected, rel=1e-3
    )


def test_scatter_of_white_noise_is_that_of_the_independent_averages(truth):
    rng = np.random.default_rng(3)
    setting = WelchSetting(256, 128, 96)
    estimates = []
    for _ in range(600):
        x = rng.standard_normal((1500, 1))
        estimates.append(cross_spectra(x, x, truth.FS, setting)[1][20:100, 0, 0].real)
    averages = np.mean(estimates) ** 2 / np.var(estimates, axis=0).mean()
    assert averages == pytest.approx(independent_averages(setting, 1500), rel=0.06)


def test_a_record_shorter_than_the_window_is_refused(truth):
    with pytest.raises(UndeterminedError, match="shorter than one Welch window"):
        cross_spectra(np.zeros((100, 1)), np.zeros((100, 1)), truth.FS, FINE)


def test_a_setting_that_makes_no_sense_is_refused():
    with pytest.raises(ValueError, match="n_overlap"):
        WelchSetting(256, 128, 128)


def test_settings_keep_their_duration_at_another_rate():
    assert FINE.scaled(1000.0) == WelchSetting(16384, 16384, 8192)
    assert SMOOTH.scaled(1000.0) == WelchSetting(16384, 4096, 3072)
