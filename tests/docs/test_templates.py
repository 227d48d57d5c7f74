"""The templates of docs/adding.md fit the code as it is."""

import importlib.util
import re
import sys
import tomllib
from pathlib import Path

import numpy as np
from impid_host.effects import friction
from impid_host.effects.catalogue import CATALOGUE
from impid_host.effects.effect import Effect
from impid_host.study import columns_log, foreign_log
from impid_host.study.setup_file import read_setup

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "adding.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    """The page's block of code in one language."""
    found = re.search(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)
    assert found is not None
    return found[1]


def test_the_effect_is_the_one_it_copies() -> None:
    path = ROOT / "tests" / "host" / "effects" / "apparatus.py"
    spec = importlib.util.spec_from_file_location("apparatus_of_effects", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    names = dict(vars(friction))
    exec(block("python"), names)
    row = names["ROW"]
    assert isinstance(row, Effect)
    assert row.name not in CATALOGUE
    lab = module.apparatus(next(iter(module.KINDS)))
    ours, theirs = (list(each.terms(lab.setting)) for each in (row, CATALOGUE["friction.quadratic"]))
    assert [term.where for term in ours] == [term.where for term in theirs]
    for mine, other in zip(ours, theirs, strict=True):
        for view in lab.views:
            added = mine.columns(view, 0.0)["torque"]
            assert np.any(added)
            np.testing.assert_array_equal(added, other.columns(view, 0.0)["torque"])


def test_the_accelerometer_is_read(tmp_path: Path) -> None:
    assert tomllib.loads(block("toml"))["accelerometer"]["part"] == "ADXL335"
    head = 'format = "impid-study/1"\n'
    robot = '[robot]\nmodel = "planar-2r-absolute"\nlink_lengths_m = [0.254, 0.2667]\n'
    (tmp_path / "setup.toml").write_text(head + robot + block("toml"))
    read = read_setup(tmp_path / "setup.toml").accelerometer
    assert read is not None
    assert read.zero_g_V == (1.5, 1.5)


def test_files_that_it_names_are_there() -> None:
    named = set(re.findall(r"`((?:host|hil_sim|firmware|scripts|docs|tests)/[\w./-]+)`", TEXT))
    assert len(named) >= 10
    assert [name for name in sorted(named) if not (ROOT / name).exists()] == ["firmware/boards/my_board/"]


def test_an_importer_has_what_it_says() -> None:
    (section,) = re.findall(r"## An importer\n(.*?)\n## ", TEXT + "\n## ", re.DOTALL)
    said = set(re.findall(r"`(\w+Log|open_\w+)`", section))
    assert said == {"ColumnsLog", "ForeignLog", "open_log"}
    assert said <= {*vars(foreign_log), *vars(columns_log)}
