"""From aligned trials to the signals of the spectral method."""

import numpy as np
import pytest
from impid_host.impedance.spectral.repeatability import repeatability
from impid_host.impedance.stochastic import _unaveraged


@pytest.mark.parametrize("rows", [1, 2, 4])
def test_the_mean_over_a_log_s_period_is_undone(rows):
    """The mean of sin over a period T is sinc(f T) sin: 6.6e-4 too little at 10 Hz and 500 rows a second."""
    rate, f = 1000.0, 10.0
    t = np.arange(4000) / rate
    truth = np.sin(2 * np.pi * f * t)
    mean = truth * np.sinc(f * rows / rate)
    back = _unaveraged(mean[:, np.newaxis], float(rows))[20:-20, 0]
    left = np.abs(back - truth[20:-20]).max()
    assert left < 0.05 * np.abs(mean - truth).max()


def test_trials_of_different_perturbations_are_not_judged_for_repeatability():
    rng = np.random.default_rng(1)
    commands = tuple(rng.standard_normal((1000, 2)) for _ in range(3))
    signals = tuple(c + 0.1 * rng.standard_normal(c.shape) for c in commands)
    assert "different perturbations" in repeatability(signals, ("x", "y"), commands).verdict
    again = (commands[0],) * 3
    signals = tuple(c + 0.1 * rng.standard_normal(c.shape) for c in again)
    assert "repeat each other" in repeatability(signals, ("x", "y"), again).verdict
    moved = (*signals[:2], rng.standard_normal((1000, 2)))
    assert "trials differ" in repeatability(moved, ("x", "y"), again).verdict
