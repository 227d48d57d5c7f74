"""`impid-host import` as a user runs it."""

import subprocess
import sys
from pathlib import Path

import pytest
from impid_host.study.folder import read_study

MAPPING = """\
[setup.robot]
model = "slide-1d"
[columns]
t = "t"
theta1 = { column = "x", unit = "mm" }
tau1 = { expression = "35.15 * u" }
[[trial]]
name = "free_01"
kind = "free"
"""


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from impid_host.cli import main; main()", "import", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "map.toml").write_text(MAPPING)
    (tmp_path / "log.csv").write_text("t,x,u\n0,1,2\n0.5,3,4\n")
    return tmp_path


def test_a_log_becomes_a_study(folder: Path) -> None:
    done = run(folder, "log.csv", "--mapping", "map.toml", "--out", "study")
    assert done.returncode == 0
    assert done.stderr.startswith("next: impid-host check ") and done.stderr.count("\n") == 1
    assert done.stdout == "free_01: free, 2 rows, 0.500 s\n1 trials written to study\n"
    log = read_study(folder / "study").trials[0].robot
    assert log.theta[:, 0].tolist() == pytest.approx([1e-3, 3e-3])
    assert log.tau[:, 0].tolist() == pytest.approx([70.3, 140.6])


def test_warnings_are_one_line_each(folder: Path) -> None:
    (folder / "log.csv").write_text("t,x,u\n0,1,2\n0,1,2\n0.5,3,4\n")
    done = run(folder, "log.csv", "--mapping", "map.toml", "--out", "study")
    assert done.returncode == 0
    first, second = done.stderr.splitlines()
    assert first == (
        "warning: log.csv: 1 rows repeat the stamp before them (first in row 3); they are left out"
    )
    assert second.startswith("next: impid-host check ")


@pytest.mark.parametrize(
    ("log", "says"),
    [
        (
            "t,x,u\n0,1,2\n1,oops,2\n",
            "log.csv, row 3: column x holds 'oops', not a number; correct that value",
        ),
        ("t,x\n0,1\n", "log.csv: has no column u, which map.toml names for tau1 (it has: t, x)"),
        ("", "log.csv: is empty"),
        ("t,x,u\n", "log.csv: has a header but no rows"),
        ("t,x,u\n1,1,2\n0,1,2\n", "log.csv, row 3: t goes backwards"),
    ],
)
def test_a_wrong_log_is_one_line_and_leaves_nothing(folder: Path, log: str, says: str) -> None:
    (folder / "log.csv").write_text(log)
    done = run(folder, "log.csv", "--mapping", "map.toml", "--out", "study")
    assert done.returncode == 1
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("impid-host: ")
    assert says in done.stderr
    assert not (folder / "study").exists()


def test_missing_files_and_an_existing_study(folder: Path) -> None:
    for log, mapping, says in (
        ("no.csv", "map.toml", "no.csv: does not exist"),
        ("log.csv", "no.toml", "no.toml"),
    ):
        done = run(folder, log, "--mapping", mapping, "--out", "study")
        assert done.returncode == 1
        assert says in done.stderr
        assert len(done.stderr.splitlines()) == 1
    assert run(folder, "log.csv", "--mapping", "map.toml", "--out", "study").returncode == 0
    again = run(folder, "log.csv", "--mapping", "map.toml", "--out", "study")
    assert again.returncode == 1
    assert "study: is there already" in again.stderr


def test_the_help_shows_an_example(folder: Path) -> None:
    done = run(folder, "--help")
    assert done.returncode == 0
    assert "Example:" in done.stdout
    assert "--mapping" in done.stdout
