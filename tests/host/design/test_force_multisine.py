import numpy as np
import pytest
from impid_host.design.force_multisine import design_force_multisines
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.best_linear import best_linear_approximation


def test_experiments_have_the_asked_power_lines_and_orthogonality():
    design = design_force_multisines(3.0, realisations=2)
    assert design.force.shape == (2, 2, 5000, 2)
    np.testing.assert_allclose(np.sqrt(np.mean(design.force**2, axis=2)), 3.0)
    spectrum = np.abs(np.fft.rfft(design.force, axis=2))
    excited = np.flatnonzero(spectrum[0, 0, :, 0] > 1e-6 * spectrum.max())
    np.testing.assert_array_equal(excited, design.harmonics)
    assert np.all(excited % 2 == 1)
    assert excited.max() / 10.0 <= 15.0
    # over the two experiments the axes are uncorrelated, line by line
    U = np.fft.rfft(design.force[0], axis=1)[:, design.harmonics]
    product = np.einsum("ekj,ekl->kjl", U.conj(), U)
    assert np.max(np.abs(product[:, 0, 1])) < 1e-9 * np.max(np.abs(product[:, 0, 0]))
    np.testing.assert_array_equal(design.command(1, 0)[5000:10000], design.force[1, 0])
    assert len(design.command(0, 1)) == 25000


def test_held_arm_with_its_own_movements_is_found_from_the_designed_experiments():
    """Robot, hold and arm in closed form, periodic steady state; the arm pushes by itself, the position is
    noisy.
    """
    rng = np.random.default_rng(1)
    design = design_force_multisines(4.0, realisations=6, periods=3)
    M, n, N, _ = design.force.shape
    s = 2j * np.pi * np.fft.rfftfreq(N, 1 / design.fs)[:, None, None]
    arm = (
        s**2 * np.array([[1.4, 0.6], [0.6, 1.0]])
        + s * np.diag([11.0, 6.0])
        + np.array([[170.0, 30], [30, 110.0]])
    )
    robot = s**2 * np.diag([1.0, 1.3]) + s * 4.0 * np.eye(2) + 60.0 * np.eye(2)
    both = np.linalg.inv(arm + robot)
    own = np.zeros((M, n, 3, N // 2 + 1, 2), dtype=complex)
    own[..., 1:200, :] = 40 * (
        rng.standard_normal((M, n, 3, 199, 2)) + 1j * rng.standard_normal((M, n, 3, 199, 2))
    )
    commanded = np.fft.rfft(design.force, axis=2)[:, :, None]
    d = np.einsum("fij,mepfj->mepfi", both, commanded + own)
    F = np.einsum("fij,mepfj->mepfi", arm, d) - own
    d_t, F_t = np.fft.irfft(d, N, axis=3), np.fft.irfft(F, N, axis=3)
    result = best_linear_approximation(F_t, d_t, design.fs, design.harmonics, design.force)
    exact = np.linalg.inv(arm[design.harmonics])
    z = np.abs(result.G - exact) / result.total_sd
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.3)
    assert result.p_value > 0.01
    high = result.frequency_Hz > 10
    assert np.max(np.abs(result.G - exact)[high] / np.abs(exact).max(axis=(1, 2), keepdims=True)[high]) < 0.05


def test_what_has_no_lines_is_refused():
    with pytest.raises(UndeterminedError, match="fewer than two odd lines"):
        design_force_multisines(1.0, period_s=0.1)
    with pytest.raises(UndeterminedError, match="whole number of samples"):
        design_force_multisines(1.0, period_s=1.0001)
