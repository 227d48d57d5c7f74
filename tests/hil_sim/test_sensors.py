"""Each sensor against its data sheet or a closed form."""

from typing import Any

import numpy as np
import pytest
from scipy.signal import welch

from hil_sim.sensors import adc
from hil_sim.sensors.accelerometer import STANDARD_GRAVITY, AccelerometerTruth, Output, OutputFilter
from hil_sim.sensors.encoder import EncoderTruth

RATE = 8000.0


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


def volts(sensor, acceleration, q2=0.0):
    """Settled output for a constant acceleration in the base frame, V."""
    n = 200
    q = np.tile([0.3, q2], (n + 1, 1))
    _, filtered = OutputFilter(sensor, 1 / RATE).drive(q, np.tile(acceleration, (n, 1)))
    return Output(sensor, 1 / RATE, np.random.default_rng(1)).volts(filtered)[-1]


def test_noise_density_is_that_of_the_data_sheet_up_to_the_filter():
    sensor = truth(noise_density_ug_per_rtHz=110.0)
    output = Output(sensor, 1 / RATE, np.random.default_rng(5)).volts(np.zeros((800_000, 2)))
    f, density = welch((output - 1.65) / 0.62, fs=RATE, nperseg=4096, axis=0)
    flat = np.sqrt(density[(f > 5) & (f < 50)].mean(axis=0))
    corner = np.sqrt(density[(f > 480) & (f < 520)].mean(axis=0))
    assert flat == pytest.approx(110e-6, rel=0.02)
    assert corner / flat == pytest.approx(np.sqrt(0.5), rel=0.03)


@pytest.mark.parametrize("frequency_Hz", [5.0, 100.0, 500.0])
def test_output_filter_is_first_order_at_500_hz(frequency_Hz):
    """Gain and phase of 1 / (1 + i f / 500) for a drive given as means over each step."""
    n = 16_000
    edges = np.arange(n + 1) / RATE
    omega = 2.0 * np.pi * frequency_Hz
    means = np.diff(np.sin(omega * edges)) / omega * RATE  # of cos
    acceleration = np.stack([means, np.zeros(n)], axis=1) * STANDARD_GRAVITY
    _, out = OutputFilter(truth(), 1 / RATE).drive(np.zeros((n + 1, 2)), acceleration)
    half = n // 2
    response = 2.0 * np.mean(out[half:, 0] * np.exp(-1j * omega * edges[half + 1 :]))
    # The mean over a step lags by half a step and has the gain of a sinc.
    mean = np.sinc(frequency_Hz / RATE) * np.exp(-0.5j * omega / RATE)
    exact = (1.0 - np.exp(-2 * np.pi * 500 / RATE)) / (
        1.0 - np.exp(-2 * np.pi * 500 / RATE) * np.exp(-1j * omega / RATE)
    )
    assert response == pytest.approx(exact * mean, rel=1e-3)
    if frequency_Hz < 10.0:
        # Taking the drive as constant over a step of 125 us costs step^2 / (12 * 318 us) = 4 us.
        assert -np.angle(response) / omega == pytest.approx(318.3e-6 + 4.1e-6, abs=0.5e-6)
        assert abs(response) == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(
    ("q2", "mount", "turns", "expected_g"),
    [
        (0.0, 0.0, True, (1.0, 0.0)),
        (np.pi / 2, 0.0, True, (0.0, -1.0)),
        (np.pi / 2, 0.0, False, (1.0, 0.0)),
        (0.0, np.pi / 6, True, (np.cos(np.pi / 6), -0.5)),
        (np.pi / 3, -np.pi / 3, True, (1.0, 0.0)),
    ],
)
def test_axes_stand_as_the_mount_says(q2, mount, turns, expected_g):
    """An acceleration of 1 g along x, seen by axes turned by q2 and the mount."""
    sensor = truth(mount_angle_rad=mount, turns_with_link2=turns)
    assert volts(sensor, (STANDARD_GRAVITY, 0.0), q2) == pytest.approx(
        1.65 + 0.62 * np.array(expected_g), abs=1e-9
    )


def test_errors_of_offset_gain_and_cross_axis_have_their_size():
    sensor = truth(offset_mg=(20.0, -10.0), gain_error=(0.01, -0.02), cross_axis=(0.015, 0.0))
    at_rest = volts(sensor, (0.0, 0.0))
    assert at_rest == pytest.approx([1.65 + 0.62 * 0.020, 1.65 - 0.62 * 0.010])
    along_y = volts(sensor, (0.0, STANDARD_GRAVITY)) - at_rest
    assert along_y == pytest.approx([0.62 * 1.01 * 0.015, 0.62 * 0.98])


def test_output_stops_at_the_rails():
    assert volts(truth(), (10 * STANDARD_GRAVITY, -10 * STANDARD_GRAVITY)) == pytest.approx([3.3, 0.0])


def test_self_test_shifts_the_output_with_the_time_constant_of_the_filter():
    output = Output(truth(), 1 / RATE, np.random.default_rng(1))
    shift = (output.volts(np.zeros((400, 2)), self_test=True) - 1.65) / 0.62
    t = np.arange(1, 401) / RATE
    assert shift[:, 0] == pytest.approx(0.32 * (1.0 - np.exp(-t * 2 * np.pi * 500)), abs=1e-12)
    assert (output.volts(np.zeros((400, 2)))[-1] - 1.65) == pytest.approx(0.0, abs=1e-9)


def test_adc_rounds_to_the_nearest_code_and_saturates():
    lsb = 3.3 / 4096
    volts_in = np.array([0.0, 0.49 * lsb, 0.51 * lsb, 1.65, 3.3, 4.0, -1.0])
    assert adc.convert(volts_in, 3.3).tolist() == [0, 0, 1, 2048, 4095, 4095, 0]


def test_quantisation_error_of_the_adc_is_uniform():
    """A ramp through many steps: variance of one twelfth of a squared step, mean zero."""
    ramp = np.linspace(1.0, 2.0, 1_000_003)
    lsb = 3.3 / 4096
    error = adc.convert(ramp, 3.3) * lsb - ramp
    assert error.std() == pytest.approx(lsb / np.sqrt(12), rel=1e-3)
    assert abs(error.mean()) < 1e-3 * lsb


def test_encoder_counts_follow_zero_and_direction():
    encoder = EncoderTruth(counts_per_rev=(4000, 4000), zero_rad=(0.5, -0.25), direction=(1, -1))
    q = np.array([[0.5, -0.25], [0.5 + np.pi, -0.25 + np.pi]])
    assert encoder.count(q).tolist() == [[0, 0], [2000, -2000]]
    assert encoder.angle(encoder.count(q)) == pytest.approx(q)


def test_encoder_counter_wraps_as_32_bits_do():
    encoder = EncoderTruth(counts_per_rev=(2**30, 2**30), zero_rad=(0.0, 0.0), direction=(1, 1))
    assert encoder.count(np.array([[4 * np.pi, -4.5 * np.pi]])).tolist() == [[-(2**31), 2**31 - 2**28]]
