"""Hum in innovations, beside a motion whose own lines are no hum."""

import numpy as np
import pytest
from impid_host.diagnosis.lines import spectral_lines
from impid_host.diagnosis.noise import autoregression
from scipy.signal import lfilter

from .synthetic import STEP_S, Rows

TAPS = {("torque", 0): np.ones(1)}
HIGHEST_HZ = 2.0


def rows(seed: int) -> Rows:
    """Four trials of 40 s, moved by ten sinusoids up to 2 Hz."""
    own = Rows([], seed=seed, count=800, base=2)
    f = HIGHEST_HZ * np.arange(1, 11) / 10
    phase = own.rng.uniform(0, 2 * np.pi, (1, 4, 1, 2, 10))
    own.base_columns = np.sin(2 * np.pi * f * own.t[:, None, None] + phase).sum(axis=-1)
    return own


def with_line(seed: int, frequency: float, amplitude: float):
    own = rows(seed)
    phase = own.rng.uniform(0, 2 * np.pi, (1, 4, 1))
    hum = amplitude * np.sin(2 * np.pi * frequency * own.t + phase)
    return own, own.target({}) + hum


def test_white_noise_has_no_line() -> None:
    assert not any(spectral_lines(own.table(own.target({})), [], TAPS) for own in map(rows, range(25)))


@pytest.mark.parametrize("frequency", [3.3, 7.1])
def test_a_hum_is_found_at_its_frequency_with_its_amplitude(frequency: float) -> None:
    own, target = with_line(1, frequency, 0.6)
    (entry,) = spectral_lines(own.table(target), [], TAPS)
    assert (entry.variable, entry.on) == ("frequency", "tau1")
    # A line in 40 s is known to much less than 1 / 40 Hz.
    assert entry.peak == pytest.approx(frequency, abs=0.02)
    assert entry.curve[:, 1].max() == pytest.approx(0.6, rel=0.15)
    assert f"{frequency:.3g} Hz" in entry.words


@pytest.mark.parametrize("frequency", [HIGHEST_HZ, 1.4])
def test_a_line_where_the_robot_is_moved_is_the_excitation(frequency: float) -> None:
    """What an inexact model leaves of a sinusoid of the motion, the uppermost among them, is no hum."""
    own, target = with_line(2, frequency, 0.6)
    assert not spectral_lines(own.table(target), [], TAPS)


def test_a_line_that_the_noise_model_took_for_colour_is_found_all_the_same() -> None:
    own, target = with_line(3, 3.3, 1.0)
    table = own.table(target)
    taps = autoregression([run.target for run in table.runs])
    white = np.stack([lfilter(taps, [1.0], row) for row in target[0]])[None]
    (entry,) = spectral_lines(own.table(white), [], {("torque", 0): taps})
    assert entry.peak == pytest.approx(3.3, abs=0.02)
    assert STEP_S == 0.05
