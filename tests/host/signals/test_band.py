"""The motion's band, from motions whose band is known."""

import numpy as np
import pytest
from impid_host.signals.band import following, motion_band_hz
from impid_host.signals.chain import DEFAULT, PUBLISHED
from impid_host.signals.filters import ZeroPhaseLowPass


def sines(frequencies: np.ndarray, size: float, rate: float = 1000.0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(int(10 * frequencies[-1]))
    t = np.arange(0, 50, 1 / rate)
    phases = rng.uniform(0, 2 * np.pi, len(frequencies))
    return t, size * np.sin(2 * np.pi * t[:, None] * frequencies + phases).sum(axis=1)


def test_the_papers_motion_keeps_the_papers_cut_off() -> None:
    t, angle = sines(np.arange(0.2, 2.01, 0.2), 0.05)
    band = motion_band_hz(t, np.stack([angle, 0.3 * angle], axis=1))
    assert 1.6 <= band <= 2.25
    assert following(DEFAULT, [band]) is DEFAULT


@pytest.mark.parametrize("noise", [0.0, 1e-6, 1e-4])
def test_a_quick_motion_is_followed_whatever_the_encoders_noise(noise: float) -> None:
    t, angle = sines(np.array([0.5, 2.0, 7.0]), 0.05)
    angle = angle + noise * np.random.default_rng(0).normal(size=len(t))
    band = motion_band_hz(t, angle[:, None])
    assert band == pytest.approx(7.0, abs=0.3)
    chain = following(DEFAULT, [1.0, band])
    assert isinstance(chain.finish, ZeroPhaseLowPass)
    assert chain.finish.cutoff_hz == pytest.approx(2 * band, abs=0.06)
    assert chain.edge_s == pytest.approx(4.5 / chain.finish.cutoff_hz)


def test_a_joint_that_trembles_does_not_count() -> None:
    t, angle = sines(np.array([0.5, 1.0]), 0.1)
    tremble = 1e-6 * np.sin(2 * np.pi * 30 * t)
    assert motion_band_hz(t, np.stack([angle, tremble], axis=1)) == pytest.approx(1.0, abs=0.3)


def test_no_cut_off_is_wider_than_the_filters_ahead() -> None:
    chain = following(DEFAULT, [45.0])
    assert isinstance(chain.finish, ZeroPhaseLowPass)
    assert chain.finish.cutoff_hz == 40.0
    assert following(PUBLISHED, []) is PUBLISHED
