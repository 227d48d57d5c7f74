"""What a name took away against what is left, on rows of which both are known."""

import numpy as np
import pytest
from impid_host.diagnosis.adequacy import believable, excess, noise_power

from .synthetic import STEP_S, Rows, curve, term

NAME, CURVE = "friction.coulomb@joint1", "unattributed@tau1+theta1"
WIDE_HZ, NARROW_HZ = 1 / STEP_S, 2.0


def laboratory(left_rms: float, frequency_hz: float = 0.7):
    """A name of rms 2 beside something that no term holds; white noise of rms 1."""
    rows = Rows([term("friction.coulomb", "joint1"), curve("tau1", "theta1", size=1)])
    strange = np.sqrt(2.0) * left_rms * np.sin(2 * np.pi * frequency_hz * rows.t)
    return rows, rows.target({NAME: 2.0}) + strange


def test_power_of_an_autoregression_is_the_textbooks() -> None:
    """x_k = phi x_(k-1) + e of variance s^2 has the variance s^2 / (1 - phi^2)."""
    phi, s = 0.6, 0.3
    taps = np.array([1.0, -phi]) / s
    assert noise_power(taps, 20.0, WIDE_HZ) == pytest.approx(s**2 / (1 - phi**2), rel=1e-4)


def test_power_of_white_noise_in_a_band_is_its_share() -> None:
    """A Butterworth filter of order 5, forth and back, is as wide as 0.9 (pi / 10) / sin(pi / 10) of its
    corner."""
    width = 0.9 * (np.pi / 10) / np.sin(np.pi / 10)
    assert noise_power(np.ones(1), 200.0, 2.0) == pytest.approx(width * 2.0 / 100.0, rel=5e-3)


@pytest.mark.parametrize("report_hz", [WIDE_HZ, NARROW_HZ])
def test_noise_alone_has_no_excess(report_hz: float) -> None:
    rows, target = laboratory(0.0)
    table = rows.table(target)
    assert abs(excess(table, [0], report_hz)["torque", 0]) < 0.15
    assert excess(table, [], WIDE_HZ)["torque", 0] == pytest.approx(4.0, rel=0.1)


def test_a_name_stands_above_what_is_left() -> None:
    for left_rms, stands in ((0.0, True), (0.9, True), (1.5, False)):
        rows, target = laboratory(left_rms)
        assert believable(rows.table(target), [0], WIDE_HZ) == ([0] if stands else [])


def test_it_is_the_reported_band_that_counts() -> None:
    """The name is white up to 10 Hz, so a fifth of its power is below 2 Hz; a slow remainder of almost
    half its rms is a fourth of all of it, and more than that fifth."""
    rows, target = laboratory(0.95)
    table = rows.table(target)
    assert believable(table, [0], WIDE_HZ) == [0]
    assert believable(table, [0], NARROW_HZ) == []
    rows, target = laboratory(0.95, frequency_hz=8.0)
    assert believable(rows.table(target), [0], NARROW_HZ) == [0]


def test_what_a_curve_without_a_name_takes_up_is_left_as_well() -> None:
    rows = Rows([term("friction.coulomb", "joint1"), curve("tau1", "theta1", size=1)])
    table = rows.table(rows.target({NAME: 2.0, CURVE: 1.5}))
    assert believable(table, [0], WIDE_HZ) == []
    table = rows.table(rows.target({NAME: 2.0, CURVE: 0.9}))
    assert believable(table, [0], WIDE_HZ) == [0]
