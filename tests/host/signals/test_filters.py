"""Filters against closed forms."""

import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.signals.chain import CHAINS, DEFAULT, PUBLISHED, erode
from impid_host.signals.filters import SavitzkyGolay, ZeroPhaseLowPass

RATE = 1000.0
T = np.arange(0, 20, 1 / RATE)
MIDDLE = slice(5000, 15000)


def tone(frequency_hz: float) -> np.ndarray:
    return np.sin(2 * np.pi * frequency_hz * T)[:, None]


def measured_gain(values: np.ndarray, reference: np.ndarray) -> complex:
    """In-phase gain by projection, quadrature as the imaginary part."""
    quadrature = np.gradient(reference[:, 0])
    basis = np.stack([reference[MIDDLE, 0], quadrature[MIDDLE] / np.abs(quadrature).max()], axis=1)
    a, b = np.linalg.lstsq(basis, values[MIDDLE, 0], rcond=None)[0]
    return complex(a, b)


@pytest.mark.parametrize("frequency_hz", [0.5, 2.0, 4.0, 4.5, 8.0])
def test_butterworth_run_twice_has_its_closed_form_gain_and_no_phase(frequency_hz: float) -> None:
    # Bilinear transform: |H|^2 = 1 / (1 + (tan(pi f T) / tan(pi fc T))^(2n)), squared once more by filtfilt.
    gain = measured_gain(ZeroPhaseLowPass(5, 4.5).apply(tone(frequency_hz), RATE), tone(frequency_hz))
    warped = np.tan(np.pi * frequency_hz / RATE) / np.tan(np.pi * 4.5 / RATE)
    assert gain.real == pytest.approx(1 / (1 + warped**10), abs=2e-6)
    assert abs(gain.imag) < 2e-5
    assert ZeroPhaseLowPass(5, 4.5).gain(np.array([frequency_hz]), RATE)[0] == pytest.approx(
        1 / (1 + warped**10), abs=1e-6
    )


def test_savitzky_golay_reproduces_a_polynomial_of_its_order_and_its_slope() -> None:
    t = T[:2000] - 1.0
    polynomial = np.polynomial.Polynomial([0.3, -1, 2, 0.5, -0.7, 1.1, 0.2])
    savgol = SavitzkyGolay(order=6, window_s=0.151)
    values = polynomial(t)[:, None]
    # scipy solves for the 151 weights in single powers up to 75^6, which costs it ten of its sixteen digits.
    assert savgol.smooth(values, RATE)[:, 0] == pytest.approx(polynomial(t), rel=2e-5)
    assert savgol.differentiate(values, RATE)[:, 0] == pytest.approx(polynomial.deriv()(t), abs=1e-3)
    assert savgol.differentiate_twice(values, RATE)[:, 0] == pytest.approx(polynomial.deriv(2)(t), abs=0.05)


def test_published_window_is_151_samples_at_1_khz() -> None:
    # An impulse reaches 75 samples to either side and no farther.
    impulse = np.zeros((1001, 1))
    impulse[500] = 1.0
    response = SavitzkyGolay(6, 0.151).smooth(impulse, RATE)[:, 0]
    touched = np.flatnonzero(np.abs(response) > 1e-12)
    assert (touched.min(), touched.max()) == (425, 575)


@pytest.mark.parametrize("frequency_hz", [0.5, 1.0, 2.0])
def test_published_chain_is_flat_to_2_hz_and_differentiates_there(frequency_hz: float) -> None:
    # [D] Fig. 3: near unity, and near the ideal differentiator, over the perturbation's band.
    wave, slope = tone(frequency_hz), 2 * np.pi * frequency_hz * np.cos(2 * np.pi * frequency_hz * T)[:, None]
    assert abs(measured_gain(PUBLISHED.value(wave, RATE), wave) - 1) < 1e-3
    assert abs(measured_gain(PUBLISHED.derivative(wave, RATE), slope) - 1) < 1e-3


@pytest.mark.parametrize("frequency_hz", [0.5, 4.0, 10.0])
def test_default_chain_differentiates_on_a_wide_band(frequency_hz: float) -> None:
    wave = tone(frequency_hz)
    angular = 2 * np.pi * frequency_hz
    slope = angular * np.cos(angular * T)[:, None]
    assert abs(measured_gain(DEFAULT.derivative(wave, RATE), slope) - 1) < 1e-5
    assert abs(measured_gain(DEFAULT.second_derivative(wave, RATE), -(angular**2) * wave) - 1) < 1e-5


def test_erode_takes_the_margin_off_ends_and_gaps() -> None:
    valid = np.ones(20, dtype=bool)
    valid[10] = False
    assert np.flatnonzero(erode(valid, 2)).tolist() == [2, 3, 4, 5, 6, 7, 13, 14, 15, 16, 17]
    assert erode(valid, 0).tolist() == valid.tolist()


def test_only_the_default_chain_has_a_movable_cutoff() -> None:
    moved = CHAINS["default"].with_cutoff(9.0)
    assert moved.finish is not None
    assert moved.finish.cutoff_hz == 9.0
    assert moved.decimation(RATE) == 50
    for name in ("published", "emps"):
        with pytest.raises(UndeterminedError, match="fixed cut-off"):
            CHAINS[name].with_cutoff(9.0)


def test_a_cut_off_beyond_half_the_rate_is_refused() -> None:
    with pytest.raises(UndeterminedError, match="at 20 Hz have no part at 100 Hz"):
        ZeroPhaseLowPass(4, 100.0).apply(np.zeros(400), 20.0)
