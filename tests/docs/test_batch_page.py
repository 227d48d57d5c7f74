"""The commands and questions of docs/batch.md run as printed, on an archive whose answers are known."""

import datetime
import re
import shlex
from pathlib import Path
from typing import Any

import duckdb
import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from pyarrow import parquet

from tests.host.batch import studies_in_closed_form as closed_form

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "batch.md").read_text(encoding="utf-8")


def test_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for day in (1, 2):
        closed_form.write_study(closed_form.small("P07", day), tmp_path / "archive" / f"day{day}")
    (tmp_path / "archive" / "broken").mkdir()
    (tmp_path / "archive" / "broken" / "setup.toml").write_text("format = 1")
    (commands,) = re.findall(r"<!-- runs: batch -->\n```sh\n(.*?)```", TEXT, re.DOTALL)
    said = [CliRunner().invoke(cli, shlex.split(line)[1:]) for line in commands.splitlines()]
    assert [done.exit_code for done in said] == [1, 0], said[0].output  # the broken one is said
    answers: list[Any] = []
    monkeypatch.setattr("builtins.print", answers.append)
    names: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL):
        exec(block, names)
    over_time, broken, effects = answers
    dates, loads, values = list(zip(*over_time.fetchall(), strict=True))[:3]
    assert dates == (datetime.date(2026, 11, 1), datetime.date(2026, 11, 2))
    assert loads == ("spring", "spring")
    truth = [closed_form.stiffness_on(day)[0, 0] for day in (1, 2)]
    assert values == pytest.approx(truth, rel=2e-3)
    ((place, status, why, remedy),) = broken.fetchall()
    assert (place, status) == (str(tmp_path / "archive" / "broken"), "bad data")
    assert "setup.toml" in why
    assert remedy
    assert effects.fetchall() == []  # nothing was diagnosed
    (copy,) = re.findall(r"`(COPY .*?)`", TEXT)
    duckdb.sql(copy)
    done = CliRunner().invoke(cli, ["compare", "all.parquet"])
    assert (done.exit_code, done.output) == (0, said[1].output.partition("\n")[2])


def test_every_column_is_told(tmp_path: Path) -> None:
    closed_form.batch(tmp_path / "gone", tmp_path / "out")
    (path,) = (tmp_path / "out").iterdir()
    table = TEXT.partition("## Columns")[2]
    told = re.findall(
        r"[a-z_0-9]+", " ".join(line.split("|")[1] for line in table.splitlines() if "|" in line)
    )
    assert set(parquet.read_schema(path).names) == set(told) - {"column"}
