import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.welch import (
    FINE,
    SMOOTH,
    WelchSetting,
    bin_correlation,
    cross_spectra,
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


def test_scatter_and_bin_correlation_of_white_noise_are_as_predicted(truth):
    rng = np.random.default_rng(3)
    setting = WelchSetting(256, 128, 96)
    estimates = []
    for _ in range(1500):
        x = rng.standard_normal((1500, 1))
        estimates.append(cross_spectra(x, x, truth.FS, setting)[1][20:100, 0, 0].real)
    estimates = np.array(estimates)
    averages = estimates.mean() ** 2 / estimates.var(axis=0).mean()
    assert averages == pytest.approx(independent_averages(setting, 1500), rel=0.05)
    spacing = np.arange(6) * truth.FS / 256
    measured = [
        np.mean([np.corrcoef(estimates[:, k], estimates[:, k + d])[0, 1] for k in range(0, 70, 5)])
        for d in range(6)
    ]
    np.testing.assert_allclose(bin_correlation(setting, 1500, truth.FS, spacing), measured, atol=0.03)


def test_a_record_shorter_than_the_window_is_refused(truth):
    with pytest.raises(UndeterminedError, match="shorter than one Welch window"):
        cross_spectra(np.zeros((100, 1)), np.zeros((100, 1)), truth.FS, FINE)


def test_a_setting_that_makes_no_sense_is_refused():
    with pytest.raises(ValueError, match="n_overlap"):
        WelchSetting(256, 128, 128)


def test_settings_keep_their_duration_at_another_rate():
    assert FINE.scaled(1000.0) == WelchSetting(16384, 16384, 8192)
    assert SMOOTH.scaled(1000.0) == WelchSetting(16384, 4096, 3072)
