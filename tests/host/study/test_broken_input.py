"""Whatever the bytes, reading either works or ends in an error meant for the user."""

import contextlib
import warnings
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from impid_host.errors import InputError
from impid_host.study.expressions import ExpressionError, evaluate
from impid_host.study.folder import read_study
from impid_host.study.importing import import_logs
from impid_host.study.model import Study

from .conftest import DEVICE, ROBOT, SETUP

QUICK = settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])

MAPPING = """\
[setup.robot]
model = "joint-1d"
[log]
rate_hz = 10
[columns]
theta1 = { column = "a", unit = "deg", scale = 2 }
tau1 = { expression = "2 * b" }
[[trial]]
kind = "free"
name = "x"
"""

CELLS = st.one_of(
    st.floats(width=64).map(repr),
    st.integers(-(2**70), 2**70).map(str),
    st.sampled_from(
        [
            "",
            "nan",
            "-inf",
            "1e400",
            " 1 ",
            "1,5",
            '"',
            '"1"',
            "0x10",
            "1_000",
            "٣",
            "\0",
            "\r",
            "\n",
            "é",
            "#",
        ]
    ),
    st.text(max_size=8),
)


@st.composite
def damaged(draw: st.DrawFn, text: str) -> bytes:
    """A good file with bytes removed, repeated, replaced or spliced in."""
    data = bytearray(text.encode())
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(data)))
        stop = min(len(data), start + draw(st.integers(0, 30)))
        data[start:stop] = draw(
            st.one_of(st.binary(max_size=12), CELLS.map(lambda cell: cell.encode("utf-8", "replace")))
        )
    return bytes(data)


def read_quietly(folder: Path) -> Study | None:
    """The study, or None where an InputError of one line refused it; anything else is a failure."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return read_study(folder)
        except InputError as error:
            assert "\n" not in str(error)
            return None


def check_promises(study: Study) -> None:
    for trial in study.trials:
        assert (np.diff(trial.robot.t) > 0).all()
        assert np.isfinite(trial.robot.theta).all()
        assert np.isfinite(trial.robot.tau).all()
        if trial.device is not None:
            assert (trial.device.t_us[1:] > trial.device.t_us[:-1]).all()


@QUICK
@given(rows=st.lists(st.lists(CELLS, min_size=3, max_size=6), max_size=6))
def test_any_cells(study_folder: Path, rows: list[list[str]]) -> None:
    text = "\n".join(["t,theta1,theta2,tau1,tau2", *(",".join(row) for row in rows)])
    (study_folder / "free_01" / "robot.csv").write_text(text, encoding="utf-8", errors="replace", newline="")
    study = read_quietly(study_folder)
    if study is not None:
        check_promises(study)


@QUICK
@given(rows=st.lists(st.tuples(*[st.floats(-1e4, 1e4)] * 5), min_size=1, max_size=6))
def test_any_order_of_stamps(study_folder: Path, rows: list[tuple[float, ...]]) -> None:
    text = "\n".join(["t,theta1,theta2,tau1,tau2", *(",".join(map(repr, row)) for row in rows)])
    (study_folder / "free_01" / "robot.csv").write_text(text)
    study = read_quietly(study_folder)
    stamps = [row[0] for row in rows]
    assert (study is not None) == (stamps == sorted(stamps))
    if study is not None:
        assert study.trials[0].robot.t.tolist() == sorted(set(stamps))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("free_01/robot.csv", ROBOT),
        ("free_01/device.csv", DEVICE),
        ("setup.toml", SETUP),
        ("free_01/trial.toml", 'kind = "free"'),
    ],
)
@QUICK
@given(data=st.data())
def test_damaged_files(study_folder: Path, name: str, text: str, data: st.DataObject) -> None:
    (study_folder / name).write_bytes(data.draw(damaged(text)))
    study = read_quietly(study_folder)
    if study is not None:
        check_promises(study)


@QUICK
@given(data=st.data())
def test_damaged_mapping(tmp_path: Path, data: st.DataObject) -> None:
    (tmp_path / "log.csv").write_text("a,b\n1,2\n3,4\n")
    (tmp_path / "map.toml").write_bytes(data.draw(damaged(MAPPING)))
    with warnings.catch_warnings(), contextlib.suppress(InputError):
        warnings.simplefilter("ignore")
        import_logs([tmp_path / "log.csv"], tmp_path / "map.toml", "s")


@settings(QUICK, max_examples=12)  # each example is a process
@given(data=st.data())
def test_damaged_mat(tmp_path: Path, data: st.DataObject) -> None:
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, {"a": np.arange(9.0), "b": np.arange(9.0), "s": {"x": np.eye(2)}})
    raw = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(raw[: data.draw(st.integers(100, len(raw)))])
    (tmp_path / "map.toml").write_text(MAPPING)
    with warnings.catch_warnings(), contextlib.suppress(InputError):
        warnings.simplefilter("ignore")
        import_logs([path], tmp_path / "map.toml", "s")


@QUICK
@given(text=st.text("ab12()+-*/%<>=,. '\"[]{}:_sincol!&|~^@\n", max_size=40))
def test_any_formula(text: str) -> None:
    def column(name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return np.ones(3)

    with contextlib.suppress(ExpressionError):
        assert evaluate(text, column).dtype == np.float64


def test_a_file_of_one_endless_line_is_refused(study_folder: Path) -> None:
    (study_folder / "free_01" / "robot.csv").write_bytes(b"t" * (1 << 24))
    with pytest.raises(InputError, match="is no CSV text"):
        read_study(study_folder)
    (study_folder / "free_01" / "robot.csv").write_bytes(ROBOT.encode() + b"1" * (1 << 24))
    with pytest.raises(InputError) as caught:
        read_study(study_folder)
    assert caught.value.row == 5
