"""Errors of the accelerometer beyond zero, gain and cross-axis, by hand."""

from typing import Any

import numpy as np
import pytest

from hil_sim.sensors.accelerometer import STANDARD_GRAVITY, AccelerometerTruth, Output, OutputFilter

STEP_S = 125e-6


def truth(**changes):
    """A perfect, silent ADXL203 on link 2, altered by `changes`."""
    values: dict[str, Any] = {
        "zero_g_V": (1.65, 1.65),
        "sensitivity_V_per_g": (0.62, 0.62),
        "supply_V": 3.3,
        "turns_with_link2": True,
        "mount_angle_rad": 0.0,
        "bandwidth_Hz": 500.0,
        "noise_density_ug_per_rtHz": 0.0,
        "offset_mg": (0.0, 0.0),
        "gain_error": (0.0, 0.0),
        "cross_axis": (0.0, 0.0),
        "self_test_g": (0.32, 0.32),
    }
    return AccelerometerTruth(**(values | changes))


def felt(sensor, q2, w2):
    """Mean specific force over each substep with the end point at rest, g."""
    q = np.stack([np.zeros_like(q2), q2], axis=1)
    w = np.stack([np.zeros_like(w2), w2], axis=1)
    return OutputFilter(sensor, STEP_S).drive(q, np.zeros((q2.size - 1, 2)), w)[0]


def test_a_sensor_off_the_end_point_feels_the_turning():
    """Turning at 3 rad/s and 40 rad/s^2: -w^2 l towards the axis, w' l across."""
    t = np.arange(9) * STEP_S
    w = 3.0 + 40.0 * t
    sensor = truth(lever_m=(0.02, -0.01), mount_angle_rad=0.7)
    found = felt(sensor, np.zeros(9), w) * STANDARD_GRAVITY
    middle = 0.5 * (w[1:] + w[:-1])
    expected = np.stack([-(middle**2) * 0.02 + 40.0 * 0.01, 40.0 * 0.02 + middle**2 * 0.01], axis=1)
    assert found == pytest.approx(expected, abs=1e-6)


def test_gravity_is_felt_with_the_other_sign_and_turns_with_the_link():
    sensor = truth(gravity_m_s2=(0.3, -0.2))
    found = felt(sensor, np.full(3, np.pi / 2), np.zeros(3)) * STANDARD_GRAVITY
    # Axes at 90 degrees: the first along y, the second along -x.
    assert found[-1] == pytest.approx([0.2, 0.3])


def test_a_ratiometric_output_follows_its_supply():
    """10 % less supply: zero and sensitivity fall alike, so a converter on that supply sees nothing."""
    drive = np.full((4, 2), 0.5)
    full = Output(truth(nominal_supply_V=3.3), STEP_S, np.random.default_rng(1)).volts(drive)
    low = Output(truth(supply_V=2.97, nominal_supply_V=3.3), STEP_S, np.random.default_rng(1)).volts(drive)
    assert full == pytest.approx(1.65 + 0.31)
    assert low == pytest.approx(0.9 * full)


def test_warmth_moves_zero_and_gain():
    """After one time constant 63.2 % of 10 degrees: 0.1 mg and 0.1 % for each."""
    sensor = truth(warm_up_C=10.0, warm_up_s=1.0, gain_per_C=(0.001, 0.0))
    output = Output(sensor, STEP_S, np.random.default_rng(1))
    volts = np.concatenate([output.volts(np.ones((4000, 2))) for _ in range(3)])
    warmth = 10.0 * (1.0 - np.exp(-8000 * STEP_S))
    expected = 1.65 + 0.62 * (np.array([1.0 + 0.001 * warmth, 1.0]) + 1e-4 * warmth)
    assert volts[8000] == pytest.approx(expected, abs=1e-9)
    assert volts[0] == pytest.approx([2.27, 2.27])


def test_allan_deviation_of_the_noise_falls_as_the_root_of_time():
    """White noise of density N (one-sided): Allan deviation N / sqrt(2 T) for averages over T."""
    sensor = truth(noise_density_ug_per_rtHz=110.0)
    volts = Output(sensor, STEP_S, np.random.default_rng(4)).volts(np.zeros((4_000_000, 2)))
    g = (volts[:, 0] - 1.65) / 0.62
    for seconds in (0.1, 1.0):
        means = g.reshape(-1, round(seconds / STEP_S)).mean(axis=1)
        allan = np.sqrt(0.5 * np.mean(np.diff(means) ** 2))
        chance = 3.0 / np.sqrt(2.0 * means.size / 1.5)
        assert allan == pytest.approx(110e-6 / np.sqrt(2.0 * seconds), rel=chance)
