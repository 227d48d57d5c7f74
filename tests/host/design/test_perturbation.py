from itertools import combinations

import numpy as np
import pytest
import scipy.signal
from impid_host.design.hold import hold_force, measured_velocity
from impid_host.design.perturbation import design_perturbation, filtered_noise, pairwise_coherence
from impid_host.impedance.spectral.welch import FINE


def test_the_noise_has_the_spectrum_of_the_published_filter():
    x = filtered_noise(3, 400_000)
    assert x.mean() == pytest.approx(0.0, abs=1e-12)
    assert np.sqrt(np.mean(x**2)) == pytest.approx(1.0)
    frequency, power = scipy.signal.welch(x, fs=500.0, nperseg=2000)
    flat = power[(frequency > 1) & (frequency < 10)].mean()
    for f in (5.0, 14.0, 15.0, 17.0, 20.0):
        # the digital Butterworth by the bilinear transform, in closed form
        expected = 1 / (1 + (np.tan(np.pi * f / 500) / np.tan(np.pi * 15 / 500)) ** 16)
        at = np.abs(frequency - f) < 0.3
        assert power[at].mean() / flat == pytest.approx(expected, rel=0.25, abs=1e-3)


def test_one_seed_is_one_signal():
    np.testing.assert_array_equal(filtered_noise(5, 1000), filtered_noise(5, 1000))
    assert not np.allclose(filtered_noise(5, 1000), filtered_noise(6, 1000))


def test_the_search_finds_the_least_coherent_pair_of_all():
    design = design_perturbation(4.0, candidates=6)
    assert design.force.shape == (25000, 2)
    np.testing.assert_allclose(np.sqrt(np.mean(design.force**2, axis=0)), 4.0)
    signals = [filtered_noise(seed, 25000) for seed in range(6)]
    means = {}
    for a, b in combinations(range(6), 2):
        f, coherence = scipy.signal.coherence(signals[a], signals[b], fs=500.0, nperseg=8192, noverlap=4096)
        means[a, b] = coherence[(f > 0) & (f <= 15)].mean()
    assert tuple(sorted(design.seeds)) == min(means, key=means.__getitem__)
    assert design.mean_coherence == pytest.approx(min(means.values()), rel=1e-8)
    assert design.chance_coherence == pytest.approx(np.mean(list(means.values())), rel=1e-8)
    # five averages of unrelated signals have a mean coherence of 1/5
    assert design.chance_coherence == pytest.approx(0.2, abs=0.02)
    np.testing.assert_allclose(design.force[:, 1] / 4.0, filtered_noise(design.seeds[1], 25000))


def test_three_axes_are_mutually_incoherent():
    design = design_perturbation(1.0, axes=3, candidates=20)
    coherence = pairwise_coherence(design.force, 500.0, 15.0, FINE)
    off = coherence[np.triu_indices(3, 1)]
    assert off.max() == pytest.approx(design.mean_coherence)
    assert off.max() < 0.2


def test_what_cannot_be_searched_is_refused():
    with pytest.raises(ValueError, match="candidate"):
        design_perturbation(1.0, axes=3, candidates=2)
    with pytest.raises(ValueError, match="shorter than one window"):
        design_perturbation(1.0, duration_s=5.0)


def test_hold_law_is_a_spring_and_a_damper_about_the_test_location():
    F = hold_force(
        np.array([[1.0, 2.0]]),
        np.array([[0.1, 0.2]]),
        np.array([0.0, 0.2]),
        np.array([[0.0, -1.0]]),
        kp=50.0,
        kd=3.0,
    )
    np.testing.assert_allclose(F, [[1 - 5, 2 + 3]])


def test_velocity_of_a_ramp_and_of_a_sine_at_the_cutoff():
    t = np.arange(5000) / 500.0
    v = measured_velocity(np.stack([2.0 * t, np.sin(2 * np.pi * 20 * t)], axis=1), 500.0)
    assert v[-1, 0] == pytest.approx(2.0)
    # backward difference: 2 fs sin(pi f / fs); the filter takes 3 dB
    amplitude = 2 * 500 * np.sin(np.pi * 20 / 500) / np.sqrt(2)
    assert np.abs(v[2500:, 1]).max() == pytest.approx(amplitude, rel=0.01)
