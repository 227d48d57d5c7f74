"""Examples run as they are printed."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.study.folder import read_study

ROOT = Path(__file__).resolve().parents[3]


def test_the_example_of_import(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The mapping that --help names takes the variables of the published file (docs/data.md)."""
    shown = CliRunner().invoke(cli, ["import", "--help"]).output
    found = re.search(r"impid-host (import DATA_EMPS\.mat --mapping (\S+) --out \S+)", shown)
    assert found is not None
    t = np.arange(300) * 1e-3
    variables = {
        "t": t[:, None],
        "qm": np.sin(t)[:, None],
        "qg": np.sin(t + 1e-3)[:, None],
        "vir": np.cos(t)[:, None],
        "gtau": 35.15,
    }
    scipy.io.savemat(tmp_path / "DATA_EMPS.mat", variables)
    monkeypatch.chdir(tmp_path)
    command = found[1].replace(found[2], str(ROOT / found[2]))
    done = CliRunner().invoke(cli, shlex.split(command))
    assert done.exit_code == 0, (done.output, done.exception)
    robot = read_study(tmp_path / "emps").trials[0].robot
    assert robot.tau[:, 0] == pytest.approx(35.15 * np.cos(t))
