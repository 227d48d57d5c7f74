"""Calibration in place by the command, of a recording of the simulated laboratory whose sensor is known."""

import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from impid_host.calibration.accelerometer import AccelerometerCalibration
from impid_host.cli import cli
from impid_host.recording.reader import read_recording
from impid_host.study.setup_file import read_setup


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("free")
    command = [sys.executable, "-c", "from impid_host.cli import main; main()", "record"]
    command += ["--sim", "first-light:free_01", "--speed", "5", "--duration", "30", "--seed", "4"]
    subprocess.run(
        [*command, "--out", str(folder / "free_01.mcap")], check=True, capture_output=True, timeout=120
    )
    return folder


def test_the_sensor_of_the_setup_is_found(recorded: Path) -> None:
    """The simulated sensor is exactly that of its setup: zeros and gains follow from volts by hand."""
    setup_file, out = recorded / "free_01.setup.toml", recorded / "board.json"
    arguments = ["device", "calibrate", "in-place", str(recorded / "free_01.mcap")]
    segments = read_recording(recorded / "free_01.mcap").segments
    result = CliRunner().invoke(cli, [*arguments, "--setup", str(setup_file), "--out", str(out)])
    assert result.exit_code == 0, (result.output, result.exception, len(segments))
    found = AccelerometerCalibration.from_json(out.read_text())
    sensor = read_setup(setup_file).accelerometer
    assert sensor is not None
    per_volt = sensor.full_scale_code / sensor.vref_V
    for axis, (zero, gain, angle) in enumerate(
        ((found.zero_x, found.gain_x, found.angle_x), (found.zero_y, found.gain_y, found.angle_y))
    ):
        assert gain.value == pytest.approx(sensor.sensitivity_V_per_g[axis] * per_volt, rel=5e-3)
        assert zero.value == pytest.approx(sensor.zero_g_V[axis] * per_volt, abs=20)
        assert angle.value == pytest.approx(0.0, abs=5e-3)
        assert gain.interval < 0.02 * gain.value
    assert found.residual_g < 5e-3
