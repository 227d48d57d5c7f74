import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.agreement import agreement

FREQUENCY = np.array([1.0, 2.0, 6.0])


def test_vaf_and_r_squared_follow_the_appendix_by_hand():
    """One axis: model gain 100 (40 dB) and phase 45 deg; estimate 20 dB more at 1 Hz, 9 deg more at 2 Hz."""
    Z_m = np.full((3, 1, 1), 100 * np.exp(1j * np.pi / 4))
    Z_e = Z_m * np.array([10, np.exp(1j * np.deg2rad(9)), 1])[:, None, None]
    gamma2 = np.array([0.5, 1.0, 1.0])[:, None, None]
    psi_z = (10 * 0.5 * 20) ** 2 + 9**2
    psi_n = (10 * 0.5 * 40) ** 2 + (10 * 40) ** 2 + (0.5 * 45) ** 2 + 45**2
    result = agreement(FREQUENCY, Z_e, Z_m, gamma2, 5.0)
    assert result.vaf_percent[0, 0] == pytest.approx(100 * (1 - psi_z / psi_n))
    assert result.r_squared == pytest.approx(1 - psi_z / psi_n)


def test_r_squared_sums_the_elements_before_it_divides():
    Z_m = np.full((3, 2, 2), 100.0 + 0j)
    Z_e = Z_m.copy()
    Z_e[:, 0, 1] *= 10
    result = agreement(FREQUENCY, Z_e, Z_m, np.ones(Z_m.shape), 10.0)
    np.testing.assert_allclose(result.vaf_percent, [[100, 75], [100, 100]])
    assert result.r_squared == pytest.approx(1 - 0.25 / 4)


def test_vanishing_elements_are_not_a_number_and_do_not_spoil_the_rest():
    Z_m = np.broadcast_to(100.0 * np.eye(2), (3, 2, 2)).astype(np.complex128)
    result = agreement(FREQUENCY, Z_m + 0.01, Z_m, np.ones(Z_m.shape), 10.0)
    assert np.isnan(result.vaf_percent[0, 1])
    assert result.r_squared > 0.999


def test_an_empty_band_is_refused():
    Z = np.ones((3, 1, 1), dtype=complex)
    with pytest.raises(UndeterminedError, match="no frequency"):
        agreement(FREQUENCY, Z, Z, np.ones((3, 1, 1)), 0.5)
