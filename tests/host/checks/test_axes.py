"""How a sensor of two axes is turned, mirrored and scaled: from vectors whose map is known."""

import numpy as np
import pytest
from impid_host.checks.axes import axis_map, corrected
from impid_host.checks.factors import nearest
from impid_host.checks.looks import flat_share
from impid_host.checks.wraps import unwrapped

VECTORS = np.random.default_rng(3).normal(size=(400, 2))


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize("turn", [0.0, np.pi / 2, -np.pi / 2, 0.5, -1.1])
@pytest.mark.parametrize("mirrored", [False, True])
def test_turn_and_mirror_are_found_and_undone(turn, mirrored):
    # A sensor turned by `turn` reads R(-turn) v; mirrored, its second axis points the other way.
    reading = np.diag([1.0, -1.0 if mirrored else 1.0]) @ rotation(-turn) @ VECTORS.T
    reading = 9.80665 * reading.T + 0.3
    found = axis_map(reading, VECTORS)
    assert found is not None and found.is_map and found.mirrored is mirrored
    assert found.turn == pytest.approx(turn, abs=1e-6)
    assert found.gains[0].value == found.gains[1].value == pytest.approx(9.80665)
    np.testing.assert_allclose(corrected(reading - 0.3, found), VECTORS, atol=1e-9)


def test_a_gain_of_a_few_percent_and_a_small_turn_are_no_mistake():
    found = axis_map((1.05 * rotation(-0.08) @ VECTORS.T).T, VECTORS)
    assert found is not None and not found.off


def test_readings_that_follow_nothing_are_no_map():
    found = axis_map(np.random.default_rng(4).normal(size=(400, 2)), VECTORS)
    assert found is not None and not found.is_map


@pytest.mark.parametrize(
    ("measured", "expected"),
    [(9.9, 9.80665), (0.0176, np.pi / 180), (4.05, 4.0), (1.1, None), (0.9, None), (1.515, 1.515)],
)
def test_factors_that_people_lose(measured, expected):
    factor = nearest(measured)
    assert (factor is None) if expected is None else factor.value == pytest.approx(expected)


def test_flat_tops_at_any_level_but_not_a_sine_nor_noise():
    t = np.linspace(0, 60, 30_000)
    sines = sum(np.sin(2 * np.pi * f * t + f) for f in (0.31, 0.77, 1.3, 1.9))
    noise = np.random.default_rng(5).normal(0, 0.02, len(t))
    counted = np.round((sines + noise) * 500)
    assert flat_share(counted) == 0.0
    assert flat_share(np.clip(counted, -800, 800)) > 0.05
    assert flat_share(np.round(np.sin(t) * 2000)) == 0.0 or flat_share(np.sin(t)) < 0.2


def test_a_counter_of_16_bits_is_joined_and_32_bits_left_alone():
    true = np.round(80_000 * np.sin(np.linspace(0, 20, 20_000)))
    wrapped = (true + 2**15) % 2**16 - 2**15
    joined = unwrapped(wrapped, (2.0**16,))
    assert joined.size == 2**16
    np.testing.assert_array_equal(joined.values - joined.values[0], true - true[0])
    assert unwrapped(true, (2.0**16,)).size == 0.0
