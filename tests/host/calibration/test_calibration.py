"""Calibrations against readings made from a known sensor, and the coverage of their intervals."""

import numpy as np
import pytest
from impid_host.calibration.accelerometer import AccelerometerCalibration
from impid_host.calibration.in_place import calibrate_in_place, second_derivative
from impid_host.calibration.tumble import calibrate_by_angles, calibrate_by_circle
from impid_host.errors import UndeterminedError

ZERO = np.array([32900.0, 32510.0])
GAIN = np.array([12400.0, 12010.0])
ANGLE = (0.02, -0.013)
NAMES = ("zero_x", "zero_y", "gain_x", "gain_y", "angle_x", "angle_y")
TRUTH = dict(zip(NAMES, (*ZERO, *GAIN, *ANGLE), strict=True))


def read(a: np.ndarray) -> np.ndarray:
    """The sensor: each axis reads the component of a along its own direction, by hand."""
    x_axis = np.array([np.cos(ANGLE[0]), np.sin(ANGLE[0])])
    y_axis = np.array([-np.sin(ANGLE[1]), np.cos(ANGLE[1])])
    return ZERO + GAIN * np.column_stack([a @ x_axis, a @ y_axis])


def upright(angle_rad: np.ndarray) -> np.ndarray:
    return np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])


EIGHT = np.arange(8) * np.pi / 4 + 0.1


def check(found: AccelerometerCalibration, tolerance: dict[str, float]) -> None:
    for name, allowed in tolerance.items():
        assert getattr(found, name).value == pytest.approx(TRUTH[name], abs=allowed), name


def test_known_angles_give_every_number() -> None:
    found = calibrate_by_angles(read(upright(EIGHT)), EIGHT)
    check(found, dict.fromkeys(NAMES, 1e-6))
    back = found.specific_force(read(upright(EIGHT)))
    assert back == pytest.approx(upright(EIGHT), abs=1e-9)


def test_the_circle_gives_all_but_the_common_turn() -> None:
    """Turning the sensor as a whole changes no reading's length: only the angles' difference is seen."""
    found = calibrate_by_circle(read(upright(EIGHT + 0.3 * np.sin(np.arange(8)))))
    check(found, dict.fromkeys(NAMES[:4], 1e-4))
    assert found.angle_y.value == pytest.approx(ANGLE[1] - ANGLE[0], abs=1e-8)
    lengths = np.linalg.norm(found.specific_force(read(upright(EIGHT))), axis=1)
    assert lengths == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("known", [True, False])
def test_intervals_hold_the_truth_as_often_as_they_say(known: bool) -> None:
    """300 calibrations with 5 mg of noise: 95 % promised, 2 sigma of that count is 2.5 %."""
    rng = np.random.default_rng(3)
    truth = dict(TRUTH) if known else {**TRUTH, "angle_y": ANGLE[1] - ANGLE[0]}
    names = [name for name in NAMES if known or name != "angle_x"]
    hits = dict.fromkeys(names, 0)
    for _ in range(300):
        codes = read(upright(EIGHT)) + rng.normal(0, 60.0, (8, 2))
        found = calibrate_by_angles(codes, EIGHT) if known else calibrate_by_circle(codes)
        for name in names:
            estimate = getattr(found, name)
            hits[name] += abs(estimate.value - truth[name]) <= estimate.interval
    for name, count in hits.items():
        assert 0.91 <= count / 300 <= 0.985, (name, count)


@pytest.mark.parametrize(
    ("angles", "words"),
    [
        (EIGHT[:5], "5 positions do not determine"),
        (np.linspace(0, np.pi, 8), "degrees of the circle empty"),
    ],
)
def test_positions_that_do_not_determine_it(angles: np.ndarray, words: str) -> None:
    with pytest.raises(UndeterminedError, match=words):
        calibrate_by_angles(read(upright(angles)), angles)
    with pytest.raises(UndeterminedError, match=words):
        calibrate_by_circle(read(upright(angles)))


def test_readings_of_a_board_that_was_not_still() -> None:
    rng = np.random.default_rng(4)
    with pytest.raises(UndeterminedError, match="do not fit one circle"):
        calibrate_by_circle(read(upright(EIGHT)) * rng.uniform(0.8, 1.2, (8, 2)))


def motion(rng: np.random.Generator, seconds: float = 40.0) -> tuple[np.ndarray, np.ndarray]:
    """A path of sinusoids below 3 Hz: position (m) and its exact acceleration (g), (N, 2)."""
    t = np.arange(0, seconds, 1e-3)
    position, acceleration = np.zeros((len(t), 2)), np.zeros((len(t), 2))
    for axis in range(2):
        for frequency in rng.uniform(0.3, 3.0, 8):
            w, phase = 2 * np.pi * frequency, rng.uniform(0, 2 * np.pi)
            position[:, axis] += 0.01 * np.sin(w * t + phase)
            acceleration[:, axis] -= 0.01 * w**2 * np.sin(w * t + phase) / 9.80665
    return position, acceleration


def test_the_second_derivative_of_a_parabola_and_of_a_sine() -> None:
    t = np.arange(0, 1, 1e-3)[:, None]
    assert second_derivative(3 * t**2, 1000.0) == pytest.approx(6.0, abs=1e-4)
    got = second_derivative(np.sin(20 * t), 1000.0)[2:-2]
    assert got == pytest.approx(-400 * np.sin(20 * t[2:-2]), abs=1e-3)


def test_in_place_with_quantised_positions() -> None:
    """Counts of 50 um on the path, 2 mg of white noise on the sensor: gains to 0.3 %, angles to 3 mrad."""
    rng = np.random.default_rng(8)
    position, acceleration = motion(rng)
    counted = np.round(position / 5e-5) * 5e-5
    codes = np.round(read(acceleration) + rng.normal(0, 25, acceleration.shape))
    found = calibrate_in_place(codes, second_derivative(counted, 1000.0) / 9.80665, 1000.0)
    check(found, {"zero_x": 5, "zero_y": 5, "gain_x": 37, "gain_y": 36, "angle_x": 3e-3, "angle_y": 3e-3})
    for name in NAMES:
        estimate = getattr(found, name)
        assert abs(estimate.value - TRUTH[name]) < 2 * estimate.interval, name
        assert estimate.interval > 0


def test_in_place_intervals_under_residuals_that_hang_together() -> None:
    """Noise that holds for 0.5 s: intervals of independent samples would be 20 times too small."""
    rng = np.random.default_rng(9)
    hits, trials = 0, 60
    for _ in range(trials):
        _, acceleration = motion(rng, 25.0)
        slow = rng.normal(0, 80, (50, 2)).repeat(500, axis=0)
        found = calibrate_in_place(read(acceleration) + slow, acceleration, 1000.0)
        hits += abs(found.gain_x.value - GAIN[0]) <= found.gain_x.interval
    assert hits >= 0.85 * trials


def test_motions_that_do_not_determine_it() -> None:
    rng = np.random.default_rng(10)
    _, acceleration = motion(rng)
    with pytest.raises(UndeterminedError, match=r"5\.0 s of motion"):
        calibrate_in_place(read(acceleration[:5000]), acceleration[:5000], 1000.0)
    along_x = acceleration * [1.0, 0.0]
    with pytest.raises(UndeterminedError, match="along both axes"):
        calibrate_in_place(read(along_x), along_x, 1000.0)
    still = rng.normal(0, 1e-4, acceleration.shape)
    with pytest.raises(UndeterminedError, match="only to"):
        calibrate_in_place(ZERO + rng.normal(0, 60, still.shape), still, 1000.0)


def test_it_is_written_and_read_back() -> None:
    found = calibrate_by_angles(read(upright(EIGHT)), EIGHT)
    assert AccelerometerCalibration.from_json(found.to_json()) == found
    assert found.board_settings() == {  # readings without noise: no interval to speak of
        "ACCEL_X_ZERO": 32900,
        "ACCEL_Y_ZERO": 32510,
        "ACCEL_X_PER_G": 12400,
        "ACCEL_Y_PER_G": 12010,
        "ACCEL_X_ANGLE": 20_000,
        "ACCEL_Y_ANGLE": -13_000,
        **{f"ACCEL_{axis}_{name}_INTERVAL": 0 for axis in "XY" for name in ("ZERO", "PER_G", "ANGLE")},
    }
    for text in ("{}", "[1]", '{"format": "impid-calibration/1"}'):
        with pytest.raises(ValueError, match="calibration of impid"):
            AccelerometerCalibration.from_json(text)
