"""`info`, and exports that other libraries read back."""

import json
from pathlib import Path

import can
import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result
from impid_host.cli import cli
from impid_host.errors import InputError
from impid_host.link.address import Address
from impid_host.recording.reader import read_recording
from impid_host.samples import FLAG_RESET
from scipy.io import loadmat

from tests.host.recording.boards import PtyBoard, SlcanBoard
from tests.host.recording.test_reconnect import Session


@pytest.fixture(scope="module")
def serial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One second, a reset, another second."""
    folder = tmp_path_factory.mktemp("serial")
    board = PtyBoard(link=folder / "tty")
    Session(Address(port=board.port), folder / "free_01.mcap").at(1.0, board.reset).run(2.0)
    board.close()
    return folder / "free_01.mcap"


@pytest.fixture(scope="module")
def over_can(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("can")
    board = SlcanBoard()
    Session(Address(can=f"slcan:{board.port}"), folder / "free_01.mcap").run(1.0)
    board.close()
    return folder / "free_01.mcap"


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [str(a) for a in arguments])


def test_info_of_two_boots(serial: Path) -> None:
    result = run("info", serial)
    assert result.exit_code == 0, result.exception
    said = result.output
    for words in ("run 0 (boot 77)", "run 1 (boot 78)", "boot (before 77", "hard bound", "health: uptime_s"):
        assert words in said
    told = json.loads(run("info", "--json", serial).output)
    assert [r["stored"] for r in told["runs"]] == [len(s) for s in read_recording(serial).segments]
    assert told["runs"][1]["balanced"] is True
    assert told["warnings"] == []
    assert told["health"]["last_reset"] == "PIN"


def test_info_of_a_cut_off_file_says_how_much_is_missing(serial: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(serial.read_bytes()[: serial.stat().st_size // 3])
    said = run("info", cut).output
    stored = sum(map(len, read_recording(cut).segments))
    assert "cut off" in said
    assert "up to 0.1 s before its end is missing" in said
    assert f"{stored} samples could be read" in said
    assert stored > 200


def test_parquet_and_mat_hold_every_sample_of_every_run(serial: Path, tmp_path: Path) -> None:
    for name in ("x.parquet", "x.mat"):
        result = run("export", serial, "--out", tmp_path / name)
        assert result.exit_code == 0, result.exception
    table = pq.read_table(tmp_path / "x.parquet")
    mat = loadmat(tmp_path / "x.mat")
    segments = read_recording(serial).segments
    for column in ("t_us", "ax", "ay", "enc1", "enc2", "flags"):
        want = np.concatenate([getattr(s.samples, column) for s in segments])
        assert np.array_equal(table[column].to_numpy(), want)
        assert np.array_equal(mat[column][:, 0], want)
    assert np.array_equal(table["run"].to_numpy(), np.repeat([0, 1], [len(s) for s in segments]))
    assert mat["flags"][len(segments[0]), 0] & FLAG_RESET


@pytest.mark.parametrize("name", ["x.asc", "x.blf"])
def test_can_logs_are_read_by_python_can(over_can: Path, tmp_path: Path, name: str) -> None:
    result = run("export", over_can, "--out", tmp_path / name)
    assert result.exit_code == 0, result.exception
    frames = list(can.LogReader(tmp_path / name))
    accel = [frame for frame in frames if frame.arbitration_id == 0x110]
    (segment,) = read_recording(over_can).segments
    assert len(accel) >= len(segment) >= 1000
    low16 = [int.from_bytes(frame.data[4:6], "little") for frame in accel[: len(segment)]]
    assert low16 == (segment.index & np.uint64(0xFFFF)).tolist()
    times = np.array([frame.timestamp for frame in frames])
    assert np.all(np.diff(times) >= 0)
    assert 0.9 < times[-1] - times[0] < 3


def test_wrong_files_are_one_clear_line(serial: Path, tmp_path: Path) -> None:
    (tmp_path / "there.mat").write_bytes(b"x")
    cases = [
        (["export", serial, "--out", tmp_path / "x.blf"], "holds no CAN frames"),
        (["export", serial, "--out", tmp_path / "there.mat"], "is there already"),
        (["export", serial, "--out", tmp_path / "no" / "x.mat"], "mkdir -p"),
        (["info", tmp_path / "missing.mcap"], "cannot be read"),
        (["info", tmp_path / "there.mat"], "is not an MCAP file"),
    ]
    for arguments, words in cases:
        result = run(*arguments)
        assert isinstance(result.exception, InputError), result.output
        assert words in str(result.exception)
    assert (tmp_path / "there.mat").read_bytes() == b"x"
    assert not list(tmp_path.glob(".part*"))
