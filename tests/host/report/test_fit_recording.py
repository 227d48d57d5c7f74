"""`impid-host fit` on a recording and its robot log, without a study folder in between."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from impid_host.cli import cli


def test_fit_and_sync_read_a_recording_as_it_was_recorded(tmp_path: Path) -> None:
    recording = tmp_path / "free_01.mcap"
    record = [
        "record", "--sim", "first-light:free_01", "--seed", "3", "--speed", "4", "--duration", "12",
        "--out", str(recording),
    ]  # fmt: skip
    made = CliRunner().invoke(cli, record, catch_exceptions=False)
    assert made.exit_code == 0, made.output
    inputs = [
        str(recording),
        "--robot-log",
        str(tmp_path / "free_01.robot.csv"),
        "--setup",
        str(tmp_path / "free_01.setup.toml"),
        "--json",
        "-",
    ]
    fitted = CliRunner().invoke(cli, ["fit", *inputs], catch_exceptions=False)
    robot = json.loads(fitted.stdout)["robot"]
    # The scenario's truth, [D] Table VI; 12 s hold the inertias to a few percent.
    for name, true in (("alpha1", 0.06929), ("alpha3", 0.04416)):
        assert robot["parameters"][name]["value"] == pytest.approx(true, rel=0.02)
    assert robot["acceleration"] == ["accelerometer"]
    (trial,) = json.loads(CliRunner().invoke(cli, ["sync", *inputs], catch_exceptions=False).stdout)["trials"]
    assert trial["name"] == "free_01"
    # Two clocks of -21 and +43 ppm.
    assert abs(trial["drift_ppm"]) == pytest.approx(64.0, abs=1.0)
