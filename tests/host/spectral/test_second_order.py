import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.second_order import (
    fit_second_order,
    impedance_error_factor,
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


def test_intervals_cover_the_truth_and_the_fit_is_unbiased():
    """Errors of a known correlated law: the mean must hit the truth, the spread the stated deviations."""
    rng = np.random.default_rng(4)
    M, B, K = (
        np.array([[1.4, 0.6], [0.6, 1.0]]),
        np.array([[11.0, 3.0], [3.0, 6.0]]),
        np.array([[170.0, 30], [30, 110.0]]),
    )
    Z = second_order_impedance(FREQUENCY, M, B, K)
    n_f = len(FREQUENCY)
    left = np.tile(0.004 * np.array([[1.0, 0.3j], [-0.3j, 0.8]]), (n_f, 1, 1)) / (
        1 + FREQUENCY[:, None, None] ** 2
    )
    right = np.tile(np.array([[0.5, 0.1], [0.1, 0.4]], dtype=complex), (n_f, 1, 1))
    factor = impedance_error_factor(FREQUENCY, Z, left, right)
    correlation = np.exp(-0.5 * ((FREQUENCY[:, None] - FREQUENCY) / 0.15) ** 2)
    root = np.linalg.cholesky(correlation + 1e-10 * np.eye(n_f))
    gamma2 = np.broadcast_to(1 / (1 + 2 / (1 + FREQUENCY[:, None, None] ** 2)), Z.shape)
    truth = np.concatenate([M.ravel(), B.ravel(), K.ravel()])
    found, stated = [], []
    for _ in range(200):
        z = (rng.standard_normal((n_f, 2, 2)) + 1j * rng.standard_normal((n_f, 2, 2))) / np.sqrt(2)
        z = np.einsum("fg,gab->fab", root, z)
        # the exact impedance of the disturbed compliance, not the linearised one
        C = np.linalg.inv(2j * np.pi * FREQUENCY[:, None, None] * Z) + left @ z @ right
        noisy = np.linalg.inv(2j * np.pi * FREQUENCY[:, None, None] * C)
        fit = fit_second_order(FREQUENCY, noisy, gamma2, error_factor=factor, error_correlation=correlation)
        found.append(np.concatenate([fit.M.ravel(), fit.B.ravel(), fit.K.ravel()]))
        stated.append(np.concatenate([fit.M_sd.ravel(), fit.B_sd.ravel(), fit.K_sd.ravel()]))
    found, stated = np.array(found), np.array(stated)
    np.testing.assert_allclose(found.std(axis=0), stated.mean(axis=0), rtol=0.2)
    assert np.all(
        np.abs(found.mean(axis=0) - truth) < 4 * found.std(axis=0) / np.sqrt(200) + 0.1 * found.std(axis=0)
    )
    covered = np.mean(np.abs(found - truth) < 1.96 * stated)
    assert covered == pytest.approx(0.95, abs=0.03)


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
