"""The tutorial's and the README's commands run as printed, and print what the page says."""

import importlib.util
import re
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pyarrow.parquet
import pytest
import scipy.io
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.study.folder import read_study

from hil_sim.cli import cli as simulator

ROOT = Path(__file__).resolve().parents[2]
TUTORIAL = ROOT / "docs" / "tutorial.md"
PROGRAMS = {"impid-host": cli, "impid-sim": simulator}


def _load() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "printed_commands", ROOT / "scripts" / "printed_commands.py"
    )
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


printed_commands = _load()


def run(kind: str) -> int:
    """Run the tutorial's steps of one kind in this folder; how many commands there were."""
    count = 0
    for step in printed_commands.steps(TUTORIAL):
        if step.kind != kind:
            continue
        printed = ""
        for command in step.commands:
            if command[:2] == ("impid-sim", "serve"):
                continue  # the caller runs it beside the others
            done = CliRunner().invoke(PROGRAMS[command[0]], command[1:])
            assert done.exit_code == 0, (command, done.output, done.exception)
            printed += done.output
            count += 1
        assert printed_commands.missing(step.shown, printed) == [], printed
    return count


def test_lines_that_were_not_printed_are_found() -> None:
    printed = "│ Kxx │ 421.4 +- 0.76 │ N/m │\nnothing is wrong"
    assert printed_commands.missing(("Kxx 421.6 +- 0.75 N/m", "nothing ... wrong"), printed) == []
    for line in ("Kxx 321.6 +- 0.75 N/m", "Kyy 421.4", "wrong ... nothing", "421.4 N/m"):
        assert printed_commands.missing((line,), printed) == [line]


def test_every_line_that_begins_with_a_program_is_marked() -> None:
    marked = {shlex.join(command) for step in printed_commands.steps(TUTORIAL) for command in step.commands}
    blocks = re.findall(r"^```sh\n(.*?)^```", TUTORIAL.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    printed = {
        shlex.join(shlex.split(line, comments=True)) for block in blocks for line in block.splitlines()
    }
    assert printed == marked
    assert {step.kind for step in printed_commands.steps(TUTORIAL)} == {"quick", "slow", "board", "measured"}


def test_the_simulated_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("quick") >= 9
    assert [trial.kind for trial in read_study(tmp_path / "study").trials] == ["free", "mass-spring"]
    for picture in ("robot", "parameters_spring_K1_M1", "force_spring_K1_M1", "ellipses_spring_K1_M1"):
        assert (tmp_path / "figures" / f"{picture}.png").exists()


def test_the_steps_of_the_readme_are_those_of_the_tutorial() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = re.search(r"These lines run as they stand.*?```\n(.*?)```", text, re.DOTALL)
    assert block is not None
    steps = [step for step in printed_commands.steps(TUTORIAL) if step.kind == "quick"]
    known = {command[:3] for step in steps for command in step.commands}
    commands = [tuple(shlex.split(line, comments=True)) for line in block[1].splitlines()]
    assert {command[1] for command in commands} >= {"record", "export", "check", "fit", "diagnose", "judge"}
    assert {command[:3] for command in commands} <= known


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_robot_that_hides_something(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("slow") == 3


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_the_board_with_the_simulators(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In real time, so that the clocks are those of a board."""
    monkeypatch.chdir(tmp_path)
    steps = printed_commands.steps(TUTORIAL)
    (serve,) = (c for step in steps for c in step.commands if c[:2] == ("impid-sim", "serve"))
    code = "import sys; from hil_sim.cli import main; sys.argv[0] = 'impid-sim'; main()"
    board = subprocess.Popen([sys.executable, "-c", code, *serve[1:]], stdout=subprocess.PIPE, text=True)
    try:
        assert board.stdout is not None
        assert '"ready"' in board.stdout.readline()
        assert run("board") == 6
    finally:
        board.send_signal(signal.SIGTERM)
        board.wait(timeout=30)


@pytest.mark.measured
def test_the_measured_record(measured_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The published file again, from the table of the measured data."""
    table = pyarrow.parquet.read_table(measured_data / "emps" / "bangbang.parquet")
    named = {"t": "t_s", "qg": "q_ref_m", "qm": "q_meas_m", "vir": "u_V"}
    columns = {name: np.asarray(table[column])[:, None] for name, column in named.items()}
    scipy.io.savemat(tmp_path / "DATA_EMPS.mat", {**columns, "gtau": 35.15065188})
    shutil.copytree(ROOT / "docs" / "mappings", tmp_path / "docs" / "mappings")
    monkeypatch.chdir(tmp_path)
    assert run("measured") == 4
