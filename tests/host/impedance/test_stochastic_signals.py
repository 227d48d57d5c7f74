"""From aligned trials to the signals of the spectral method."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from impid_host.impedance.spectral.repeatability import repeatability
from impid_host.impedance.stochastic import _staircase, _unaveraged, held_by_rows
from scipy.interpolate import CubicSpline


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


def test_a_command_held_from_row_to_row_is_told_from_a_faster_log():
    rng = np.random.default_rng(2)
    command = rng.standard_normal((2000, 2))
    assert held_by_rows(command)
    assert not held_by_rows(np.repeat(command, 2, axis=0))
    assert not held_by_rows(np.zeros((2000, 2)))
    assert not held_by_rows(None)


def test_what_a_mean_makes_of_a_staircase_is_undone():
    """A force that follows the staircase of a 10 Hz command; the log averages 2 ms about each switch."""
    rows, f, T = 4000, 10.0, 2e-3
    t_rows = np.arange(rows) * T
    p = np.sin(2 * np.pi * f * t_rows)
    mean = 0.5 * (p + np.concatenate([[0.0], p[:-1]]))
    # what the staircase holds at 10 Hz itself: later by half a period, smaller by sinc
    true = np.sinc(f * T) * np.sin(2 * np.pi * f * (t_rows - T / 2))
    fine = np.arange(2 * rows - 2) * T / 2
    one: Any = SimpleNamespace(aligned=SimpleNamespace(rate_hz=1000.0), log_rate_hz=500.0)
    P, logged = (CubicSpline(t_rows, x)(fine)[:, np.newaxis] * [1.0, 0.0] for x in (p, mean))
    force = _unaveraged(logged, 2.0)
    mended = force + _staircase(P, np.eye(2), one)
    expected = CubicSpline(t_rows, true)(fine)
    before, after = (np.abs(x[100:-100, 0] - expected[100:-100]).max() for x in (force, mended))
    assert before > 5e-4
    assert after < 0.05 * before
