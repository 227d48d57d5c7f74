"""A calibration is applied by exports and fits, wherever the recording carries it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from impid_host.calibration.accelerometer import AccelerometerCalibration, Estimate
from impid_host.calibration.applied import (
    FoundCalibration,
    apply,
    as_metadata,
    calibrated,
    read_calibration,
    recorded_calibration,
)
from impid_host.cli import cli
from impid_host.errors import InputError
from impid_host.recording import channels
from impid_host.samples import ForeignSamples
from impid_host.signals.counts import specific_force
from impid_host.study.folder import read_study
from impid_host.study.model import NO_CODES, AccelerometerSetup, RobotSetup, Setup

SENSOR = AccelerometerSetup("ADXL203", 3.3, 65536, (1.65, 1.65), (0.62, 0.62), "link2", 0.3)
FOUND = AccelerometerCalibration(
    "tumble",
    Estimate(32000.5, 3.0),
    Estimate(33100.25, 4.0),
    Estimate(12100.0, 8.0),
    Estimate(12500.0, 9.0),
    Estimate(0.004, 1e-4),
    Estimate(-0.012, 2e-4),
    1e-3,
    8,
)


def test_codes_become_the_force_that_the_calibration_says() -> None:
    """Its own equation, code = zero + S a, turned into codes here and read back through the setup."""
    a = np.array([[0.3, -0.8], [1.0, 0.2], [-0.5, 0.6]])
    codes = np.array([32000.5, 33100.25]) + a @ FOUND.sensitivity().T
    many = np.repeat(codes, 4000, axis=0)
    dithered = np.floor(many + np.random.default_rng(0).random(many.shape)).astype(np.uint16)
    rows = len(many)
    samples = ForeignSamples(
        np.arange(rows, dtype=np.uint64),
        np.arange(rows, dtype=np.uint32),
        np.zeros(rows, np.uint8),
        codes=dithered,
    )
    felt = specific_force(samples, calibrated(SENSOR, FOUND)).reshape(3, 4000, 2).mean(axis=1) / 9.80665
    assert felt == pytest.approx(a, abs=3e-6)
    assert np.abs(specific_force(samples, SENSOR)[0] / 9.80665 - a[0]).max() > 0.02


def test_what_a_recording_carries_is_read_back() -> None:
    found = recorded_calibration({channels.METADATA_CALIBRATION: as_metadata(FOUND)})
    assert found is not None
    assert found.calibration == FOUND


def test_the_boards_settings_are_a_calibration_once_it_has_intervals() -> None:
    stored = {name.lower(): str(value) for name, value in FOUND.board_settings().items()}
    found = recorded_calibration({channels.METADATA_SETTINGS: stored})
    assert found is not None
    assert found.calibration.gain_x == Estimate(12100.0, 8.0)
    assert found.calibration.angle_y.value == pytest.approx(-0.012)
    assert found.calibration.zero_y.value == 33100  # whole codes
    fresh = {name: ("0" if name.endswith("interval") else value) for name, value in stored.items()}
    assert recorded_calibration({channels.METADATA_SETTINGS: fresh}) is None
    assert recorded_calibration({}) is None


def test_what_was_given_goes_before_what_the_board_keeps() -> None:
    other = replace(FOUND, zero_x=Estimate(30000.0, 1.0))
    stored = {name.lower(): str(value) for name, value in other.board_settings().items()}
    found = recorded_calibration(
        {channels.METADATA_CALIBRATION: as_metadata(FOUND), channels.METADATA_SETTINGS: stored}
    )
    assert found is not None
    assert found.calibration.zero_x.value == 32000.5


def test_an_accelerometer_without_codes_cannot_be_calibrated_so() -> None:
    setup = Setup(RobotSetup("slide-1d"), accelerometer=NO_CODES)
    with pytest.raises(InputError, match="no accelerometer by its codes"):
        apply(setup, FoundCalibration(FOUND, "x"), Path("board.json"))


def test_what_is_no_calibration(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text("[]")
    with pytest.raises(InputError, match="device calibrate"):
        read_calibration(tmp_path / "x.json")
    with pytest.raises(InputError, match="cannot be read"):
        read_calibration(tmp_path / "y.json")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two seconds of the simulated board, the calibration kept in the recording."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "board.json").write_text(FOUND.to_json())
    arguments = [
        "record",
        "--sim",
        "first-light:free_01",
        "--duration",
        "2",
        "--out",
        str(folder / "free_01.mcap"),
    ]
    done = CliRunner().invoke(cli, [*arguments, "--calibration", str(folder / "board.json")])
    assert done.exit_code == 0, done.output
    return folder


def export(recorded: Path, study: Path, *more: str) -> tuple[int, str]:
    done = CliRunner().invoke(cli, ["export", str(recorded / "free_01.mcap"), "--out", str(study), *more])
    return done.exit_code, done.output + str(done.exception or "")


def test_the_export_applies_it_and_says_so(recorded: Path, tmp_path: Path) -> None:
    code, said = export(recorded, tmp_path / "s")
    assert code == 0, said
    assert "accelerometer as calibrated (tumble, given to the recording)" in said
    sensor = read_study(tmp_path / "s").setup.accelerometer
    assert sensor is not None
    assert sensor.zero_g_V[0] == pytest.approx(32000.5 * 3.3 / 65536)
    assert sensor.sensitivity_V_per_g[1] == pytest.approx(12500.0 * 3.3 / 65536)
    assert sensor.axis_angles_rad == (0.004, -0.012)
    # Once more into the same study: the same calibration is no contradiction; another is.
    code, said = export(recorded, tmp_path / "s", "--trial", "free_02")
    assert code == 0, said
    other = tmp_path / "other.json"
    other.write_text(replace(FOUND, zero_x=Estimate(30000.0, 1.0)).to_json())
    code, said = export(recorded, tmp_path / "s", "--trial", "free_03", "--calibration", str(other))
    assert code != 0
    assert "one study has one apparatus" in said


RIG_MAP = """
[setup.robot]
model = "planar-2r-absolute"
link_lengths_m = [0.254, 0.2667]
[log]
delimiter = ";"
[columns]
t = { column = "time ms", unit = "ms" }
theta1 = { column = "q1 deg", unit = "deg" }
theta2 = { column = "q2 deg", unit = "deg" }
tau1 = "M1"
tau2 = "M2"
[[trial]]
file = "rig*.csv"
kind = "arm"
load = "left"
subject = "P07"
"""


def test_the_robots_own_log_goes_in_by_a_mapping(recorded: Path, tmp_path: Path) -> None:
    rows = np.loadtxt(recorded / "free_01.robot.csv", delimiter=",", skiprows=1)
    own = np.column_stack([1e3 * rows[:, 0], np.rad2deg(rows[:, 1:3]), rows[:, 3:5]])
    header = "time ms;q1 deg;q2 deg;M1;M2"
    np.savetxt(tmp_path / "rig1.csv", own, delimiter=";", header=header, comments="", fmt="%.12g")
    (tmp_path / "map.toml").write_text(RIG_MAP)
    log = ["--robot-log", str(tmp_path / "rig1.csv"), "--mapping", str(tmp_path / "map.toml")]
    code, said = export(recorded, tmp_path / "s", *log, "--trial", "left_01")
    assert code == 0, said
    trial = read_study(tmp_path / "s").trials[0]
    assert (trial.name, trial.kind, trial.load, trial.session.subject) == ("left_01", "arm", "left", "P07")
    assert trial.robot.t == pytest.approx(rows[:, 0])
    assert trial.robot.theta == pytest.approx(rows[:, 1:3])
    assert trial.robot.tau == pytest.approx(rows[:, 3:5])
    code, said = export(
        recorded, tmp_path / "s", "--mapping", str(tmp_path / "map.toml"), "--trial", "left_02"
    )
    assert "no [[trial]] takes free_01.robot.csv" in said
