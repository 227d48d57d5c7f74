import numpy as np
import pytest
import scipy.signal
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.frequency_response import (
    derived_response,
    direct_response,
    impedance,
    noise_spectrum,
)
from impid_host.impedance.spectral.transforms import cross_spectra
from impid_host.impedance.spectral.welch import FINE, SMOOTH, WelchSetting

SETTING = WelchSetting(512, 256, 192)


@pytest.mark.parametrize(("inputs", "outputs"), [(1, 1), (2, 2), (3, 2), (2, 4)])
def test_direct_estimate_is_least_squares_over_the_segments(truth, inputs, outputs):
    rng = np.random.default_rng(1)
    u = rng.standard_normal((8000, inputs))
    y = u @ rng.standard_normal((inputs, outputs)) + rng.standard_normal((8000, outputs))
    _, S_yu = cross_spectra(y, u, truth.FS, SETTING)
    _, S_uu = cross_spectra(u, u, truth.FS, SETTING)
    H = direct_response(S_yu, S_uu)
    U, Y = truth.segment_spectra(u, SETTING), truth.segment_spectra(y, SETTING)
    brute = np.stack([np.linalg.lstsq(U[:, f], Y[:, f], rcond=None)[0].T for f in range(1, U.shape[1])])
    np.testing.assert_allclose(H[1:], brute, rtol=1e-8, atol=1e-10)


def test_single_input_agrees_with_scipy(truth):
    rng = np.random.default_rng(2)
    u = rng.standard_normal(6000)
    y = np.convolve(u, [0.2, 0.5, -0.3])[:6000] + 0.1 * rng.standard_normal(6000)
    args = {"fs": truth.FS, "nperseg": 256, "noverlap": 192, "nfft": 512}
    expected = scipy.signal.csd(u, y, **args)[1] / scipy.signal.welch(u, **args)[1]
    H = direct_response(
        cross_spectra(y[:, None], u[:, None], truth.FS, SETTING)[1],
        cross_spectra(u[:, None], u[:, None], truth.FS, SETTING)[1],
    )
    np.testing.assert_allclose(H[:, 0, 0], expected, rtol=1e-8)


def test_derived_estimate_is_the_instrumental_variable_estimate(truth):
    rng = np.random.default_rng(3)
    p, F, d = (rng.standard_normal((8000, 2)) for _ in range(3))
    F, d = F + p, d + p
    S = {
        n: cross_spectra(a, b, truth.FS, SETTING)[1] for n, a, b in (("dp", d, p), ("Fp", F, p), ("pp", p, p))
    }
    C = derived_response(direct_response(S["dp"], S["pp"]), direct_response(S["Fp"], S["pp"]))
    P, FF, D = (truth.segment_spectra(x, SETTING) for x in (p, F, d))
    for f in (5, 60, 200):
        cross_d, cross_F = D[:, f].T @ P[:, f].conj(), FF[:, f].T @ P[:, f].conj()
        np.testing.assert_allclose(C[f], cross_d @ np.linalg.inv(cross_F), rtol=1e-8)


def test_noise_spectrum_is_the_spectrum_of_the_segment_residuals(truth):
    rng = np.random.default_rng(4)
    u, y = rng.standard_normal((8000, 2)), rng.standard_normal((8000, 2))
    H = rng.standard_normal((257, 2, 2)) + 1j * rng.standard_normal((257, 2, 2))
    S = {
        n: cross_spectra(a, b, truth.FS, SETTING)[1] for n, a, b in (("yy", y, y), ("yu", y, u), ("uu", u, u))
    }
    U, Y = truth.segment_spectra(u, SETTING), truth.segment_spectra(y, SETTING)
    E = Y - np.einsum("fij,sfj->sfi", H, U)
    ratio = np.einsum("sfi,sfj->fij", E, E.conj()) / np.einsum("sfi,sfj->fij", Y, Y.conj())
    np.testing.assert_allclose(
        (noise_spectrum(H, S["yy"], S["yu"], S["uu"]) / S["yy"])[1:], ratio[1:], rtol=1e-8
    )


# Leakage of a 50 s random record is what remains: about 2 % with the short window, 1.4 % with the long one.
@pytest.mark.parametrize(("setting", "rms"), [(SMOOTH, 0.025), (FINE, 0.016)])
def test_an_arm_shaken_by_known_forces_has_its_own_impedance(truth, setting, rms):
    arm = truth.arm
    F = truth.coloured(np.random.default_rng(5), 25000, 2)
    d = truth.respond(lambda w: np.linalg.inv(truth.dynamic_stiffness(w, arm.M, arm.B, arm.K)), F)
    frequency, S_dF = cross_spectra(d, F, truth.FS, setting)
    C = direct_response(S_dF, cross_spectra(F, F, truth.FS, setting)[1])
    band = (frequency > 0.25) & (frequency < 10)
    omega = 2 * np.pi * frequency[band]
    exact = truth.dynamic_stiffness(omega, arm.M, arm.B, arm.K) / (1j * omega[:, None, None])
    error = np.abs(impedance(frequency[band], C[band]) - exact) / np.max(
        np.abs(exact), axis=(1, 2), keepdims=True
    )
    assert np.sqrt(np.mean(error**2)) < rms


def test_dependent_inputs_are_refused():
    S = np.ones((4, 2, 2), dtype=complex)
    with pytest.raises(UndeterminedError, match="linearly dependent"):
        direct_response(S, S)
