import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.best_linear import best_linear_approximation
from impid_host.impedance.spectral.distortion import distortion_levels

N, FS = 512, 512.0
HARMONICS = np.array([h for h in range(1, 80, 2) if h % 8 != 5])


def _multisine(rng, amplitude=0.1):
    phase = rng.uniform(0, 2 * np.pi, len(HARMONICS))
    t = np.arange(N) / N
    return amplitude * np.cos(2 * np.pi * np.outer(t, HARMONICS) + phase).sum(axis=1)


def _experiments(rng, realisations, periods, static, noise=0.0):
    u = np.stack([_multisine(rng) for _ in range(realisations)])[:, None, None, :, None]
    u = np.broadcast_to(u, (realisations, 1, periods, N, 1))
    return u, static(u) + noise * rng.standard_normal(u.shape)


def test_cubic_spring_stiffens_by_the_closed_form_and_scatters():
    """x + e x^3 with K lines of amplitude A: the line's own answer is 1 + 3/4 e A^2 (2K - 1)."""
    rng = np.random.default_rng(1)
    u, y = _experiments(rng, 600, 2, lambda x: x + 0.5 * x**3, noise=1e-4)
    result = best_linear_approximation(u, y, FS, HARMONICS)
    expected = 1 + 0.75 * 0.5 * 0.1**2 * (2 * len(HARMONICS) - 1)
    # the distortion itself, line by line: scatter of Y / U over the realisations by numpy alone
    Y, U = (
        np.fft.rfft(y[:, 0].mean(axis=1)[..., 0])[:, HARMONICS],
        np.fft.rfft(u[:, 0, 0, :, 0])[:, HARMONICS],
    )
    scatter = (Y / U).std(axis=0, ddof=1)
    per_realisation = (Y / U).real.mean(axis=1)
    error = per_realisation.std(ddof=1) / np.sqrt(600)
    assert error < 0.003
    assert result.G[:, 0, 0].real.mean() == pytest.approx(expected, abs=3 * error)
    np.testing.assert_allclose(result.distortion_sd[:, 0, 0], scatter, rtol=0.01)
    assert "nonlinear distortion" in result.verdict
    # the stated deviation of the mean holds the truth
    z = np.abs(result.G[:, 0, 0] - expected) / result.total_sd[:, 0, 0]
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.25)


def test_linear_system_with_noise_shows_noise_only():
    rng = np.random.default_rng(2)
    sigma = 0.2
    u, y = _experiments(rng, 8, 5, lambda x: 2.0 * x, noise=sigma)
    result = best_linear_approximation(u, y, FS, HARMONICS)
    # a DFT line of white noise, scaled to amplitude, has variance 4 sigma^2 / N; 40 periods are averaged
    expected = np.sqrt(4 * sigma**2 / N / 40) / 0.1
    assert np.sqrt(np.mean(result.noise_sd**2)) == pytest.approx(expected, rel=0.1)
    assert np.sqrt(np.mean(np.abs(result.G - 2.0) ** 2)) == pytest.approx(expected, rel=0.25)
    assert result.p_value > 0.01
    assert "linear as far as" in str(result)


def test_false_alarms_stay_at_the_stated_rate():
    rng = np.random.default_rng(3)
    draws = (_experiments(rng, 4, 3, lambda x: x, noise=0.1) for _ in range(300))
    p = [best_linear_approximation(u, y, FS, HARMONICS).p_value for u, y in draws]
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.035)


def test_two_inputs_with_noise_on_both_sides_need_the_reference():
    """u is measured with noise: without the reference |G| shrinks, with it the exact matrix comes back."""
    rng = np.random.default_rng(4)
    M, P = 200, 2
    G_true = np.array([[1.0, -0.5], [0.3, 2.0]])
    W = np.array([[1, 1], [1, -1]])
    base = np.stack([np.stack([_multisine(rng), _multisine(rng)]) for _ in range(M)])
    reference = np.einsum("mjn,je->menj", base, W)
    u = np.broadcast_to(reference[:, :, None], (M, 2, P, N, 2))
    y = u @ G_true.T + 0.1 * rng.standard_normal(u.shape)
    u = u + 0.6 * rng.standard_normal(u.shape)
    good = best_linear_approximation(u, y, FS, HARMONICS, reference)
    deviation = np.abs(good.G - G_true) / good.total_sd
    assert np.sqrt(np.mean(deviation**2)) == pytest.approx(1.0, abs=0.2)
    assert np.abs(good.G.mean(axis=0) - G_true).max() < 0.01


@pytest.mark.parametrize(
    ("static", "odd", "even"),
    [
        (lambda x: x, False, False),
        (lambda x: x + 0.02 * x**2, False, True),
        (lambda x: x + 0.02 * x**3, True, False),
        (lambda x: x + 0.02 * x**2 + 0.02 * np.sign(x), True, True),
    ],
)
def test_gaps_show_even_and_odd_distortion_each_in_its_place(static, odd, even):
    rng = np.random.default_rng(5)
    x = np.broadcast_to(_multisine(rng), (8, N))
    levels = distortion_levels(x, static(x) + 1e-3 * rng.standard_normal(x.shape), HARMONICS)
    assert (levels.p_odd < 1e-3) is odd
    assert (levels.p_even < 1e-3) is even
    assert ("odd distortion" in str(levels)) is odd
    assert ("even distortion" in str(levels)) is even
    assert levels.noise == pytest.approx(np.sqrt(4e-6 / N / 8), rel=0.2)
    free_even = np.fft.rfft(static(x[0]))[2 : HARMONICS.max() + 1 : 2] * 2 / N
    assert levels.even == pytest.approx(np.sqrt(np.mean(np.abs(free_even) ** 2)), rel=0.05, abs=1e-4)


def test_distortion_of_the_actuator_is_not_charged_to_the_load():
    rng = np.random.default_rng(6)
    x = np.broadcast_to(_multisine(rng), (8, N))
    force = x + 0.1 * x**2
    levels = distortion_levels(force, 3 * force + 1e-3 * rng.standard_normal(x.shape), HARMONICS)
    assert levels.p_even > 0.001


def test_too_little_to_tell_noise_from_distortion_is_refused():
    u = np.ones((1, 1, 3, N, 1))
    with pytest.raises(UndeterminedError, match="at least two of each"):
        best_linear_approximation(u, u, FS, HARMONICS)
    two = np.ones((2, 1, 3, N, 2))
    with pytest.raises(UndeterminedError, match="2 experiments"):
        best_linear_approximation(two, two, FS, HARMONICS)
    with pytest.raises(UndeterminedError, match="two periods"):
        distortion_levels(np.ones((1, N)), np.ones((1, N)), HARMONICS)
    with pytest.raises(UndeterminedError, match="odd harmonics only"):
        distortion_levels(np.ones((2, N)), np.ones((2, N)), np.array([1, 2, 3]))
