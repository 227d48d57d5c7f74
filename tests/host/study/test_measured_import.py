"""The shipped mappings on the measured records they were written for (docs/data.md)."""

from pathlib import Path

import numpy as np
import pytest
from impid_host.study.importing import import_logs
from impid_host.study.model import RobotLog
from scipy import signal

pytestmark = pytest.mark.measured

MAPPINGS = Path(__file__).resolve().parents[3] / "docs" / "mappings"


def load(data: Path, mapping: str, *files: str) -> dict[str, RobotLog]:
    study = import_logs([data / file for file in files], MAPPINGS / mapping, "s")
    return {trial.name: trial.robot for trial in study.trials}


def test_emps_gives_the_published_parameters(measured_data: Path) -> None:
    """The authors' least squares (4th-order zero-phase Butterworth at 100 Hz, every 10th sample).

    Their figures: M 95.1089 kg, Fv 203.5034 N s/m, Fc 20.3935 N, offset -3.1648 N.
    """
    log = load(measured_data, "emps.toml", "emps/bangbang.parquet")["bangbang_01"]
    assert len(log) == 24841
    b, a = signal.butter(4, 100, fs=1000)
    position = signal.filtfilt(b, a, log.theta[:, 0])
    velocity = np.gradient(position, 1e-3)
    regressor = np.column_stack([np.gradient(velocity, 1e-3), velocity, np.sign(velocity), np.ones(len(log))])
    rows = np.column_stack([regressor, log.tau[:, 0]])[50:-50]
    rows = signal.decimate(rows, 10, axis=0)
    found = np.linalg.lstsq(rows[:, :4], rows[:, 4], rcond=None)[0]
    np.testing.assert_allclose(found[:3], [95.1089, 203.5034, 20.3935], rtol=5e-3)
    assert found[3] == pytest.approx(-3.1648, rel=2e-2)


def test_the_leg_weighs_on_the_sensor_with_the_right_sign(measured_data: Path) -> None:
    """Static estimate without any fitted number, F = -J^-T tau, against the sensor.

    The data's README reports correlation 0.99 and about 2.6 N rms for the vertical force on this file.
    """
    log = load(measured_data, "leg_force_sensor.toml", "leg_force_sensor/press_cycles.parquet")["press_01"]
    assert log.force is not None
    shank = log.theta[:, 0] + log.theta[:, 1]
    jacobian = 0.16 * np.array(
        [
            [-np.sin(log.theta[:, 0]) - np.sin(shank), -np.sin(shank)],
            [np.cos(log.theta[:, 0]) + np.cos(shank), np.cos(shank)],
        ]
    ).transpose(2, 1, 0)
    estimate = -np.linalg.solve(jacobian, log.tau[..., None])[..., 0]
    assert np.corrcoef(estimate[:, 1], log.force[:, 1])[0, 1] > 0.98
    assert np.corrcoef(estimate[:, 0], log.force[:, 0])[0, 1] > 0.8
    assert np.sqrt(np.mean((estimate[:, 1] - log.force[:, 1]) ** 2)) < 2.8


def test_the_ankle_has_positive_inertia_and_stiffness(measured_data: Path) -> None:
    files = [f"ankle_impedance/{name}.parquet" for name in ("z_pf", "z_df", "z_df2")]
    logs = load(measured_data, "ankle_impedance.toml", *files)
    assert sorted(logs) == ["dorsiflexors_01", "dorsiflexors_02", "plantarflexors_01"]
    for log in logs.values():
        b, a = signal.butter(4, 30, fs=1000)
        angle = signal.filtfilt(b, a, log.theta[:, 0])
        velocity = np.gradient(angle, 1e-3)
        regressor = np.column_stack([np.gradient(velocity, 1e-3), velocity, angle, np.ones(len(log))])
        inertia, _, stiffness, _ = np.linalg.lstsq(
            regressor, signal.filtfilt(b, a, log.tau[:, 0]), rcond=None
        )[0]
        assert inertia > 0
        assert stiffness > 0


def test_the_double_pendulum_hangs_where_gravity_points(measured_data: Path) -> None:
    """tau1 follows 3.425 sin th1 + 1.090 sin(th1 + th2) N m (published) as far as the motion is slow."""
    file = "dfki_double_pendulum/A0_exciting_061157.parquet"
    log = load(measured_data, "dfki_double_pendulum.toml", file)["A0_exciting_061157"]
    assert len(log) == 14996
    assert (np.diff(log.t) > 0).all()
    forearm = np.sin(log.theta.sum(axis=1))
    found = np.linalg.lstsq(np.column_stack([np.sin(log.theta[:, 0]), forearm]), log.tau[:, 0], rcond=None)[0]
    np.testing.assert_allclose(found, [3.425, 1.090], rtol=0.12)


def test_jittered_stamps_are_kept_as_they_are(measured_data: Path) -> None:
    import pyarrow.parquet as pq  # noqa: PLC0415

    file = "pendubot_torque_sensor/apr2020_interp5_1.parquet"
    log = load(measured_data, "pendubot_torque_sensor.toml", file)["apr2020_interp5_1"]
    raw = pq.read_table(measured_data / file)
    np.testing.assert_array_equal(log.t, raw["t_s"].to_numpy())
    np.testing.assert_array_equal(log.tau[:, 0], -raw["torque_Nm"].to_numpy())
    assert np.diff(log.t).max() > 3 * np.median(np.diff(log.t))
