import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.second_order import (
    fit_second_order,
    second_order_impedance,
    weighted_differences,
)

FREQUENCY = np.arange(0.1, 10, 0.1)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_exact_impedance_gives_exact_parameters(n):
    rng = np.random.default_rng(n)
    M, B, K = (
        np.diag(size) + 0.2 * size * rng.standard_normal((n, n))
        for size in (np.ones(n), 8 * np.ones(n), 150 * np.ones(n))
    )
    omega = 2 * np.pi * FREQUENCY[:, None, None]
    Z = (K - omega**2 * M + 1j * omega * B) / (1j * omega)
    gamma2 = rng.uniform(0.3, 1.0, Z.shape)
    fit = fit_second_order(FREQUENCY, Z, gamma2)
    np.testing.assert_allclose(fit.M, M, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(fit.B, B, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(fit.K, K, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(second_order_impedance(FREQUENCY, M, B, K), Z, rtol=1e-12)


def test_a_decoupled_load_is_fitted_with_zero_coupling():
    M, B, K = 0.429 * np.eye(2), 0.2 * np.eye(2), 300 * np.eye(2)
    fit = fit_second_order(
        FREQUENCY, second_order_impedance(FREQUENCY, M, B, K), np.ones((len(FREQUENCY), 2, 2))
    )
    np.testing.assert_allclose(fit.K, K, atol=1e-6)
    np.testing.assert_allclose(fit.M, M, atol=1e-9)


def test_differences_are_the_appendix_by_hand():
    # one frequency, gain ratio 10 (20 dB), phases 179 and -179 deg: 2 deg apart the short way
    Z_e = np.array([[[10 * np.exp(1j * np.deg2rad(-179))]]])
    Z_m = np.array([[[np.exp(1j * np.deg2rad(179))]]])
    gain, phase = weighted_differences(Z_e, Z_m, np.array([[[0.5]]]))
    assert gain[0, 0, 0] == pytest.approx(10 * 0.5 * 20)
    assert phase[0, 0, 0] == pytest.approx(0.5 * 2)


def test_incoherent_data_are_refused():
    Z = second_order_impedance(FREQUENCY, np.eye(1), np.eye(1), np.eye(1))
    with pytest.raises(UndeterminedError, match="fewer than three frequencies"):
        fit_second_order(FREQUENCY, Z, np.zeros(Z.shape))
    with pytest.raises(UndeterminedError, match="fewer than three frequencies"):
        fit_second_order(FREQUENCY[:2], Z[:2], np.ones((2, 1, 1)))


def test_the_fit_prints_values_with_intervals_and_units():
    Z = second_order_impedance(FREQUENCY, np.eye(1), np.eye(1), np.eye(1))
    text = str(fit_second_order(FREQUENCY, Z, np.ones(Z.shape)))
    assert "kg" in text
    assert "N s/m" in text
    assert "0.10 to 9.90 Hz" in text
