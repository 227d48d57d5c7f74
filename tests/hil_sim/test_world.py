"""The whole chain: clocks, blocks and seeds; what the board and the robot report belongs together."""

import json

import numpy as np
import pyarrow.csv
import pytest
from scipy.signal import butter, sosfiltfilt

from hil_sim.scenarios.load import load, trial
from hil_sim.scenarios.schema import TorqueLogTable
from hil_sim.study.write import write_study
from hil_sim.trials import trial_truth
from hil_sim.world import World


def readings(scenario, name, seed, blocks):
    """All that the board reads in blocks of these numbers of ticks; the motion starts at 50 ms."""
    world = World(trial_truth(scenario, trial(scenario, name), seed))
    world.begin(50_000)
    at, adc, encoder = 0, [], []
    for ticks in blocks:
        reading = world.read(at, ticks)
        adc.append(reading.adc)
        encoder.append(reading.encoder)
        at += 1000 * ticks
    return np.concatenate(adc), np.concatenate(encoder)


def test_readings_do_not_depend_on_how_time_is_divided(scenario_file):
    scenario = load(str(scenario_file()))
    whole = readings(scenario, "spring_K1_M1_01", 7, [2500])
    pieces = readings(scenario, "spring_K1_M1_01", 7, [1, 2, 47, 3, 447, 1000, 999, 1])
    assert np.array_equal(whole[0], pieces[0])
    assert np.array_equal(whole[1], pieces[1])


def test_the_seed_decides(scenario_file):
    scenario = load(str(scenario_file()))
    one, again, other = (readings(scenario, "free_01", seed, [1500]) for seed in (1, 1, 2))
    assert np.array_equal(one[0], again[0])
    assert not np.array_equal(one[0], other[0])
    assert not np.array_equal(one[1], other[1])


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Three trials of first-light for 30 s, without the noise of the torque log, and their truth."""
    folder = tmp_path_factory.mktemp("study")
    scenario = load("first-light")
    world = scenario.world.model_copy(update={"torque_log": TorqueLogTable()})
    trials = tuple(t.model_copy(update={"duration_s": 30.0}) for t in scenario.trials if t.name != "free_02")
    write_study(
        scenario.model_copy(update={"trials": trials, "world": world}),
        folder / "study",
        11,
        folder / "truth.json",
    )
    return folder / "study", json.loads((folder / "truth.json").read_text())


def columns(path):
    table = pyarrow.csv.read_csv(path)
    return {name: table[name].to_numpy() for name in table.column_names}


def on_robot_clock(device, clock):
    return clock["robot_s_at_board_zero"] + (1.0 + 1e-6 * clock["drift_ppm"]) * 1e-6 * device["t_us"]


@pytest.mark.parametrize("name", ["free_01", "spring_K1_M1_01"])
def test_board_and_robot_see_the_same_angles_at_the_true_offset(study, name):
    """Encoder counts of the board against the robot's own angles: the clocks' truth holds to a microsecond.

    The offset and the drift that fit best are compared with the truth; quantisation of 16 urad over a motion
    of some rad/s leaves less than 0.5 us after averaging 28,000 rows.
    """
    folder, truth = study
    device, robot = columns(folder / name / "device.csv"), columns(folder / name / "robot.csv")
    t = on_robot_clock(device, truth["trials"][name]["clock"])
    inside = (t > robot["t"][0] + 1.0) & (t < robot["t"][-1] - 1.0)
    for joint in ("1", "2"):
        angle = device[f"enc{joint}"][inside] * 2 * np.pi / 400_000
        theirs = np.interp(t[inside], robot["t"], robot[f"theta{joint}"])
        speed = np.interp(t[inside], robot["t"], np.gradient(robot[f"theta{joint}"], robot["t"]))
        since = t[inside] - t[inside].mean()
        basis = np.stack([speed, speed * since, np.ones_like(since)], axis=1)
        offset, drift, _ = np.linalg.lstsq(basis, angle - theirs, rcond=None)[0]
        assert abs(offset) < 1e-6
        assert abs(drift) < 0.2e-6


def test_acceleration_belongs_to_the_instant_of_the_encoders(study):
    """The board's acceleration against the second derivative of its own encoders: gain 1, delay 0.

    Both are low-passed alike at 8 Hz, without phase; the delay that fits best must vanish.
    """
    folder, _ = study
    device = columns(folder / "free_01" / "device.csv")
    q = np.stack([device["enc1"], device["enc2"]], axis=1) * 2 * np.pi / 400_000
    x = np.stack(
        [
            0.254 * np.cos(q[:, 0]) + 0.2667 * np.sin(q[:, 1]),
            0.254 * np.sin(q[:, 0]) - 0.2667 * np.cos(q[:, 1]),
        ],
        axis=1,
    )
    low = butter(4, 8.0, fs=1000.0, output="sos")
    seen = (np.stack([device["ax"], device["ay"]], axis=1) / 65536 * 3.3 - 1.65) / 0.62 * 9.80665
    cosine, sine = np.cos(q[:, 1]), np.sin(q[:, 1])
    in_base = np.stack(
        [cosine * seen[:, 0] - sine * seen[:, 1], sine * seen[:, 0] + cosine * seen[:, 1]], axis=1
    )
    measured = sosfiltfilt(low, in_base, axis=0)[3000:-3000]
    twice = np.gradient(np.gradient(sosfiltfilt(low, x, axis=0), 1e-3, axis=0), 1e-3, axis=0)[3000:-3000]
    for axis in (0, 1):
        basis = np.stack([twice[:, axis], -np.gradient(twice[:, axis], 1e-3), np.ones(len(twice))], axis=1)
        gain, delay, _ = np.linalg.lstsq(basis, measured[:, axis], rcond=None)[0]
        assert gain == pytest.approx(1.0, abs=2e-3)
        assert abs(delay / gain) < 50e-6


def test_torque_in_the_log_belongs_to_its_row(study):
    """Inverse dynamics of the logged angles against the logged torque: no delay, alpha as told."""
    folder, truth = study
    robot = columns(folder / "free_01" / "robot.csv")
    q = np.stack([robot["theta1"], robot["theta2"]], axis=1)
    tau = np.stack([robot["tau1"], robot["tau2"]], axis=1)
    w = np.gradient(q, 1e-3, axis=0)
    a = np.gradient(w, 1e-3, axis=0)
    s, c = np.sin(q[:, 0] - q[:, 1]), np.cos(q[:, 0] - q[:, 1])
    zero = np.zeros(len(q))
    rows = {
        0: [a[:, 0], -0.5 * s * a[:, 1] + 0.5 * c * w[:, 1] ** 2, zero, w[:, 0], zero],
        1: [zero, -0.5 * s * a[:, 0] - 0.5 * c * w[:, 0] ** 2, a[:, 1], zero, w[:, 1]],
    }
    low = butter(4, 5.0, fs=1000.0, output="sos")
    smooth = {joint: sosfiltfilt(low, np.stack(r, axis=1), axis=0)[3000:-3000] for joint, r in rows.items()}
    torque = sosfiltfilt(low, tau, axis=0)
    rate = -np.gradient(torque, 1e-3, axis=0)[3000:-3000]
    torque = torque[3000:-3000]
    alpha = np.linalg.lstsq(np.vstack([smooth[0], smooth[1]]), torque.T.ravel(), rcond=None)[0]
    assert alpha == pytest.approx(truth["robot"]["alpha"], rel=2e-3)
    for joint in (0, 1):
        residual = torque[:, joint] - smooth[joint] @ np.array(truth["robot"]["alpha"])
        delay = residual @ rate[:, joint] / (rate[:, joint] @ rate[:, joint])
        assert abs(delay) < 20e-6


def test_force_in_the_log_is_that_of_the_load(study):
    """F = -(M x'' + K (x - x0)) from the logged angles alone, within the sensor's noise after smoothing."""
    folder, truth = study
    robot = columns(folder / "spring_K1_M1_01" / "robot.csv")
    load_truth = truth["trials"]["spring_K1_M1_01"]["load"]
    q1, q2 = robot["theta1"], robot["theta2"]
    x = np.stack([0.254 * np.cos(q1) + 0.2667 * np.sin(q2), 0.254 * np.sin(q1) - 0.2667 * np.cos(q2)], axis=1)
    a = np.gradient(np.gradient(x, 1e-3, axis=0), 1e-3, axis=0)
    force = -(a @ np.array(load_truth["M"]).T + (x - load_truth["x0"]) @ np.array(load_truth["K"]).T)
    low = butter(4, 5.0, fs=1000.0, output="sos")
    logged = sosfiltfilt(low, np.stack([robot["fx"], robot["fy"]], axis=1), axis=0)[3000:-3000]
    difference = logged - sosfiltfilt(low, force, axis=0)[3000:-3000]
    assert difference.std(axis=0).max() < 0.01
    assert logged.std(axis=0).min() > 1.0


def test_no_sample_is_missing_and_nothing_is_flagged(study):
    folder, _ = study
    device = columns(folder / "free_01" / "device.csv")
    assert np.all(np.diff(device["seq"]) == 1)
    assert np.all(np.diff(device["t_us"]) == 1000)
    assert not device["flags"][1:].any()
