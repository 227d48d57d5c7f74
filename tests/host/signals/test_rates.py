"""Logs of different rates on one clock, against a motion in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.samples import DeviceSamples, ForeignSamples
from impid_host.signals.align import AlignedTrial, align
from impid_host.signals.chain import DEFAULT
from impid_host.signals.resample import Grid, bridged, meeting_rate, onto_grid, oversampling, thinned
from impid_host.study.model import (
    AccelerometerSetup,
    EncoderSetup,
    ForceSensor,
    RobotLog,
    RobotSetup,
    Setup,
    Trial,
)

L1, L2 = 0.254, 0.2667
MODEL = Planar2RAbsolute(L1, L2)
PER_REV = 4_000_000
SETUP = Setup(
    robot=RobotSetup("planar-2r-absolute", (L1, L2)),
    encoder=EncoderSetup((PER_REV, PER_REV), (0.0, 0.0), (1, 1)),
    accelerometer=AccelerometerSetup("ADXL203", 3.3, 65536, (1.65, 1.65), (0.62, 0.62), "link2", 0.4),
)
FREQUENCIES = np.array([[0.31, 0.83, 1.41, 1.97], [0.43, 0.71, 1.57, 1.83]])
PHASES = np.array([[0.1, 2.0, 4.0, 5.0], [1.0, 3.0, 0.5, 2.5]])


def theta(t: np.ndarray, derivative: int = 0) -> np.ndarray:
    """0.7 + 0.08 sum of sines, or a derivative of it, (N, 2)."""
    w = 2 * np.pi * FREQUENCIES[:, :, None]
    argument = w * t + PHASES[:, :, None] + derivative * np.pi / 2
    offset = 0.7 if derivative == 0 else 0.0
    return (offset + 0.08 * (w**derivative * np.sin(argument)).sum(axis=1)).T


def tau(t: np.ndarray) -> np.ndarray:
    """A torque within the motion's band, (N, 2)."""
    return np.stack([np.cos(2 * np.pi * 0.9 * t), np.sin(2 * np.pi * 1.7 * t)], axis=1)


def tip_acceleration(t: np.ndarray) -> np.ndarray:
    """x'' of the planar arm whose angles are both absolute, (N, 2)."""
    (q1, q2), (w1, w2), (a1, a2) = theta(t).T, theta(t, 1).T, theta(t, 2).T
    x = -L1 * (np.sin(q1) * a1 + np.cos(q1) * w1**2) + L2 * (np.cos(q2) * a2 - np.sin(q2) * w2**2)
    y = L1 * (np.cos(q1) * a1 - np.sin(q1) * w1**2) + L2 * (np.sin(q2) * a2 + np.cos(q2) * w2**2)
    return np.stack([x, y], axis=1)


def along_sensor(t: np.ndarray) -> np.ndarray:
    """The tip's acceleration along the sensor's axes, m/s^2, (N, 2)."""
    angle, a = theta(t)[:, 1] + 0.4, tip_acceleration(t)
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * a[:, 0] + s * a[:, 1], -s * a[:, 0] + c * a[:, 1]], axis=1)


def module(rate_hz: float, seconds: float, *, felt_late_s: float = 0.0) -> DeviceSamples:
    """Our module at any rate; its clock is 100 s ahead."""
    t = np.arange(0.0, seconds, 1 / rate_hz)
    t_us = np.round((100.0 + t) * 1e6).astype(np.uint64)
    t = t_us * 1e-6 - 100.0
    counts = np.round(theta(t) * PER_REV / (2 * np.pi)).astype(np.int32)
    volts = 1.65 + 0.62 * along_sensor(t - felt_late_s) / 9.80665
    codes = np.round(volts / 3.3 * 65536).astype(np.uint16)
    rows = len(t)
    zeros = np.zeros(rows, dtype=np.uint8)
    (ax, ay), (enc1, enc2) = codes.T, counts.T
    return DeviceSamples(t_us, np.arange(rows, dtype=np.uint32), ax, ay, enc1, enc2, zeros)


def robot(rate_hz: float, seconds: float) -> RobotLog:
    t = np.arange(0.013, seconds, 1 / rate_hz)
    return RobotLog(t, theta(t), tau(t), force=tau(t))


def aligned(
    log: RobotLog, device: DeviceSamples | ForeignSamples | None, setup: Setup = SETUP
) -> AlignedTrial:
    return align(Trial("free_01", "free", "free", log, device), setup, MODEL, DEFAULT)


def worst(trial: AlignedTrial, clock_s: float) -> dict[str, float]:
    """Largest error of each signal over its largest value, where the trial is valid."""
    t, keep = trial.t - clock_s, trial.valid
    truth = {
        "theta": theta(t),
        "omega": theta(t, 1),
        "theta_dd": theta(t, 2),
        "tau": tau(t),
        "a": tip_acceleration(t),
    }
    return {
        name: float(np.abs(getattr(trial, name) - true)[keep].max() / np.abs(true).max())
        for name, true in truth.items()
    }


@pytest.mark.parametrize(
    ("robot_hz", "module_hz", "meeting_hz"),
    [
        (20.0, 1000.0, 20.0),
        (95.3, 1000.0, 95.3),
        (125.0, 1000.0, 125.0),
        (700.0, 1000.0, 700.0),
        (1000.3, 1000.0, 1000.0),
        (5000.0, 1000.0, 1000.0),
        (20_000.0, 500.0, 500.0),
        (1000.0, 100.0, 100.0),
    ],
)
def test_logs_meet_on_the_slower_rate(robot_hz: float, module_hz: float, meeting_hz: float) -> None:
    trial = aligned(robot(robot_hz, 20.0), module(module_hz, 20.0))
    assert trial.rate_hz == pytest.approx(meeting_hz, rel=1e-3)
    assert trial.valid.mean() > 0.85
    error = worst(trial, 100.0)
    # A cubic spline through 20 samples a second leaves about 0.5 % of a 1.7 Hz torque.
    assert error["tau"] < (0.01 if robot_hz < 50 else 1e-3)
    # At 100 Hz no filter but the five-point difference acts: (2 pi 2 / 100)^4 / 30 of the first derivative.
    assert max(error["theta"], error["omega"]) < 1e-4
    assert max(error["theta_dd"], error["a"]) < 3e-3


def test_what_is_faster_than_half_the_meeting_rate_does_not_fold() -> None:
    """A 93 Hz vibration of the torque would come back as 7 Hz at 100 Hz."""
    t = np.arange(0.0, 20.0, 1e-3)
    shaken = (tau(t)[:, 0] + np.sin(2 * np.pi * 93 * t))[:, None]
    grid = Grid(0.0, 100.0, 1990)
    result = onto_grid(t, shaken, np.ones(len(t), dtype=bool), grid)[:, 0]
    inside = slice(20, -20)
    assert np.abs(result - tau(grid.t)[:, 0])[inside].max() < 3e-3


def test_thinning_keeps_the_band_and_the_phase() -> None:
    t = np.arange(0.0, 10.0, 1e-3)
    for frequency, gain in ((0.5, 1.0), (3.0, 1.0), (8.0, 1.0), (14.0, 0.0), (60.0, 0.0)):
        wave = np.sin(2 * np.pi * frequency * t)
        kept = thinned(wave, 50)
        assert len(kept) == 200
        assert np.abs(kept - gain * wave[::50])[15:-15].max() < 5e-3


def test_thinning_goes_straight_through_the_ends() -> None:
    ramp = np.arange(0.0, 5.0, 1e-3)
    assert thinned(ramp, 10) == pytest.approx(ramp[::10], abs=1e-12)


def test_rates_that_differ_by_an_error_of_their_own_are_one_rate() -> None:
    assert meeting_rate(1000.0, 970.0) == 1000.0
    assert meeting_rate(1000.0, 500.0) == 500.0
    assert meeting_rate(100.0, 1000.0) == 100.0
    assert (oversampling(1000.2, 1000.0), oversampling(1000.0, 700.0), oversampling(20e3, 1e3)) == (1, 2, 20)


def test_a_gap_is_judged_by_its_own_log() -> None:
    grid = Grid(0.0, 1000.0, 9000)
    t = np.arange(0.0, 10.0, 0.01)
    every = np.ones(len(t), dtype=bool)
    assert bridged(t, every, grid).all()
    few, many = every.copy(), every.copy()
    few[500:503] = False
    many[500:510] = False
    assert bridged(t, few, grid).all()
    assert not bridged(t, many, grid)[5000:5080].any()


def test_a_module_without_angles_shares_the_robots_clock() -> None:
    log = robot(200.0, 20.0)
    t = np.arange(0.0, 20.0, 1e-3)
    rows = len(t)
    foreign = ForeignSamples(
        np.round(t * 1e6).astype(np.uint64),
        np.arange(rows, dtype=np.uint32),
        np.zeros(rows, dtype=np.uint8),
        acceleration=along_sensor(t),
    )
    trial = aligned(log, foreign)
    assert trial.clock is None
    assert trial.source == "accelerometer"
    assert trial.rate_hz == 200.0
    error = worst(trial, 0.0)
    assert error["a"] < 1e-3
    late = replace(foreign, t_us=foreign.t_us + np.uint64(500_000_000))
    with pytest.raises(UndeterminedError, match="must share the robot's clock"):
        aligned(log, late)


def test_a_module_with_angles_in_radians_is_matched_by_them() -> None:
    t = np.arange(0.0, 20.0, 1e-3)
    rows = len(t)
    foreign = ForeignSamples(
        np.round((77.0 + t) * 1e6).astype(np.uint64),
        np.arange(rows, dtype=np.uint32),
        np.zeros(rows, dtype=np.uint8),
        acceleration=along_sensor(t),
        theta=theta(t),
    )
    trial = aligned(robot(1000.0, 20.0), foreign, replace(SETUP, encoder=None))
    assert trial.clock is not None
    assert trial.clock.offset_s == pytest.approx(77.0, abs=1e-6)
    assert worst(trial, 77.0)["a"] < 1e-3


def test_a_delay_that_the_setup_states_is_taken_off() -> None:
    device = module(1000.0, 20.0, felt_late_s=3.2e-3)
    assert SETUP.accelerometer is not None
    stated = replace(SETUP, accelerometer=replace(SETUP.accelerometer, delay_s=3.2e-3))
    assert worst(aligned(robot(1000.0, 20.0), device), 100.0)["a"] > 0.02  # 2 pi 2 Hz 3.2 ms = 4 %
    assert worst(aligned(robot(1000.0, 20.0), device, stated), 100.0)["a"] < 3e-3


def test_a_force_sensor_on_the_end_effector_is_turned_into_the_base_frame() -> None:
    log = robot(1000.0, 20.0)
    assert log.force is not None
    angle = theta(log.t)[:, 1] + 0.3
    c, s, (fx, fy) = np.cos(angle), np.sin(angle), log.force.T
    turned = replace(log, force=np.stack([c * fx + s * fy, -s * fx + c * fy], axis=1))
    trial = aligned(
        turned, module(1000.0, 20.0), replace(SETUP, force_sensor=ForceSensor("mean", "link2", 0.3))
    )
    assert trial.force is not None
    assert np.abs(trial.force - tau(trial.t - 100.0))[trial.valid].max() < 1e-4


def test_a_missing_force_is_no_force() -> None:
    log = robot(1000.0, 20.0)
    assert log.force is not None
    force = log.force.copy()
    force[8000:8500] = np.nan
    trial = aligned(replace(log, force=force), module(1000.0, 20.0))
    beside = (trial.t - 100.0 > 7.5) & (trial.t - 100.0 < 9.0)
    assert not trial.valid[beside].any()
    assert trial.valid.sum() > 12_000
    nothing = aligned(replace(log, force=np.full_like(force, np.nan)), module(1000.0, 20.0))
    assert nothing.force is None
