"""From the simulator through a recording into a study folder, by the two commands."""

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from impid_host.cli import cli
from impid_host.errors import ImpidError
from impid_host.recording.reader import read_recording
from impid_host.study.folder import read_study


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [str(a) for a in arguments])


def complaint(result: Result) -> str:
    """What the user reads: `main` prints these errors as one line, with exit status 1."""
    assert isinstance(result.exception, ImpidError), result.output
    assert "\n" not in str(result.exception)
    return str(result.exception)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two short pieces of two simulated trials."""
    folder = tmp_path_factory.mktemp("recorded")
    for trial in ("free_01", "spring_K1_M1_01"):
        result = run(
            "record", "--sim", f"first-light:{trial}", "--speed", 4, "--seed", 3, "--duration", 4,
            "--out", folder / f"{trial}.mcap",
        )  # fmt: skip
        assert result.exit_code == 0, (result.output, result.exception)
        assert "samples produced by the board =" in result.output
    return folder


@pytest.fixture
def recordings(recorded: Path, tmp_path: Path) -> Path:
    shutil.copytree(recorded, tmp_path / "recorded")
    return tmp_path / "recorded"


def test_a_simulated_trial_is_recorded_whole(recorded: Path) -> None:
    recording = read_recording(recorded / "free_01.mcap")
    (ledger,) = recording.ledgers
    assert ledger.balanced
    assert ledger.stored + ledger.lost >= 4000
    samples = recording.segments[0].samples
    moved = np.abs(np.diff(samples.enc1)).max()
    assert moved > 0
    assert (recorded / "free_01.setup.toml").exists()
    assert (recorded / "free_01.robot.csv").stat().st_size > 10_000


def test_a_study_is_made_of_recordings(recordings: Path, tmp_path: Path) -> None:
    files = sorted(recordings.glob("*.mcap"))
    result = run("export", *files, "--out", tmp_path / "study")
    assert result.exit_code == 0, (result.output, result.exception)
    study = read_study(tmp_path / "study")
    assert [(t.name, t.kind, t.load) for t in study.trials] == [
        ("free_01", "free", "free"),
        ("spring_K1_M1_01", "mass-spring", "spring_K1_M1"),
    ]
    for trial, file in zip(study.trials, files, strict=True):
        want = read_recording(file).segments[0].samples
        assert trial.device is not None
        for name in ("t_us", "seq", "ax", "ay", "enc1", "enc2", "flags"):
            assert np.array_equal(getattr(trial.device, name), getattr(want, name)), name
        lines = (file.with_suffix(".robot.csv")).read_text().splitlines()
        assert trial.robot.t.tolist() == [float(line.split(",")[0]) for line in lines[1:]]
        assert trial.robot.tau[:, 1].tolist() == [float(line.split(",")[4]) for line in lines[1:]]


def test_a_study_grows_and_nothing_in_it_is_overwritten(recordings: Path, tmp_path: Path) -> None:
    study = tmp_path / "study"
    assert run("export", recordings / "free_01.mcap", "--out", study).exit_code == 0
    before = (study / "free_01" / "device.csv").read_bytes()
    assert "is there already" in complaint(run("export", recordings / "free_01.mcap", "--out", study))
    both = run("export", recordings / "spring_K1_M1_01.mcap", recordings / "free_01.mcap", "--out", study)
    assert "is there already" in complaint(both)
    assert not (study / "spring_K1_M1_01").exists()
    result = run(
        "export",
        recordings / "free_01.mcap",
        "--trial",
        "rest_02",
        "--kind",
        "arm",
        "--load",
        "left",
        "--out",
        study,
    )
    assert result.exit_code == 0
    assert [(t.name, t.kind, t.load) for t in read_study(study).trials] == [
        ("free_01", "free", "free"),
        ("rest_02", "arm", "left"),
    ]
    assert (study / "free_01" / "device.csv").read_bytes() == before


def test_wrong_input_is_one_clear_line(recordings: Path, tmp_path: Path) -> None:
    study, free = tmp_path / "study", recordings / "free_01.mcap"
    log, setup = free.with_suffix(".robot.csv"), free.with_suffix(".setup.toml")
    assert "say it with --kind" in complaint(run("export", free, "--trial", "x1", "--out", study))
    assert "not an MCAP file" in complaint(
        run("export", log, "--robot-log", log, "--setup", setup, "--kind", "free", "--out", study)
    )
    assert "missing.csv" in complaint(
        run("export", free, "--robot-log", tmp_path / "missing.csv", "--out", study)
    )
    assert "missing.toml" in complaint(
        run("export", free, "--setup", tmp_path / "missing.toml", "--out", study)
    )
    assert "holds no run 3" in complaint(run("export", free, "--run", 3, "--out", study))
    assert not study.exists()
    assert run("export", free, "--out", study).exit_code == 0
    other = tmp_path / "other.toml"
    other.write_text(setup.read_text().replace("0.254", "0.255"))
    assert "one study has one apparatus" in complaint(
        run("export", free, "--trial", "free_02", "--setup", other, "--out", study)
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["a.mcap"], "--out"),
        (["--out", "s"], "FILE"),
        (["a.mcap", "b.mcap", "--trial", "x", "--out", "s"], "one trial"),
        (["a.mcap", "b.mcap", "--robot-log", "x.csv", "--out", "s"], "2 recordings need 2"),
        (["a.mcap", "--kind", "stochastic", "--out", "s"], "go together"),
        (["a.mcap", "--kind", "leg", "--out", "s"], "leg"),
    ],
)
def test_wrong_usage(arguments: list[str], words: str) -> None:
    result = run("export", *arguments)
    assert result.exit_code == 2
    assert words in result.output


def test_an_unknown_scenario_is_named(tmp_path: Path) -> None:
    said = complaint(run("record", "--sim", "no-such:free_01", "--out", tmp_path / "a.mcap"))
    assert "no-such" in said
    assert list(tmp_path.iterdir()) == []


def test_without_a_trial_the_first_is_recorded_and_the_truth_goes_where_it_is_asked(tmp_path: Path) -> None:
    truth = tmp_path / "truth" / "free.json"
    truth.parent.mkdir()
    result = run(
        "record", "--sim", "first-light", "--speed", 4, "--duration", 2, "--truth", truth,
        "--out", tmp_path / "free.mcap",
    )  # fmt: skip
    assert result.exit_code == 0, (result.output, result.exception)
    assert "first-light:free_01" in result.output
    assert "clock" in json.loads(truth.read_text())["trials"]["free_01"]


def test_a_killed_recorder_takes_its_simulator_along(tmp_path: Path) -> None:
    out = tmp_path / "free.mcap"
    program = [sys.executable, "-c", "from impid_host.cli import main; main()"]
    recorder = subprocess.Popen([*program, "record", "--sim", "first-light:free_01", "--out", str(out)])
    deadline = time.monotonic() + 30
    while not out.exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    children = Path(f"/proc/{recorder.pid}/task/{recorder.pid}/children").read_text().split()
    recorder.kill()
    recorder.wait(10)
    (simulator,) = children
    deadline = time.monotonic() + 5
    while _runs(simulator) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not _runs(simulator)


def _runs(pid: str) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False
