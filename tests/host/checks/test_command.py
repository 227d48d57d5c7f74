"""`impid-host check`, and what `fit` prints, as a user sees it."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.study.folder import read_study, write_study
from mistakes_campaign.mistakes import MISTAKES

BY_NAME = {mistake.name: mistake for mistake in MISTAKES}


def run(*arguments):
    return CliRunner().invoke(cli, [str(argument) for argument in arguments], catch_exceptions=False)


@pytest.fixture(scope="module")
def folders(study, tmp_path_factory):
    place = tmp_path_factory.mktemp("checks")
    made = {"in order": write_study(study, place / "in_order")}
    for name in ("tau1's sign", "links swapped"):
        made[name] = write_study(BY_NAME[name].change(study), place / name.split()[0].strip("'s"))
    return made


def test_a_clean_bill(folders):
    answer = run("check", folders["in order"])
    assert answer.exit_code == 0 and "nothing contradicts itself or physics" in answer.output


def test_impossible_is_exit_status_3_in_check_and_fit_and_every_number_is_marked(folders, tmp_path):
    checked = run("check", folders["tau1's sign"], "--json", tmp_path / "check.json")
    assert checked.exit_code == 3 and "torque.sign@joint1" in checked.output
    fitted = run("fit", folders["tau1's sign"], "--json", tmp_path / "fit.json")
    assert fitted.exit_code == 3
    assert fitted.output.startswith("IMPOSSIBLE")
    rows = [line for line in fitted.output.splitlines() if "alpha1" in line or "kxx" in line]
    assert rows and all("(!)" in row for row in rows)
    for file in ("check.json", "fit.json"):
        written = json.loads((tmp_path / file).read_text())
        assert written["trusted"] is False
        assert written["checks"][0]["what"] == "torque.sign"
        assert set(written["checks"][0]) == {"what", "where", "verdict", "words", "evidence", "remedy"}


def test_a_contradiction_is_exit_status_0_and_fix_writes_beside(folders):
    folder: Path = folders["links swapped"]
    before = (folder / "setup.toml").read_text()
    answer = run("check", folder, "--fix")
    assert answer.exit_code == 0 and "links.swapped" in answer.output
    assert (folder / "setup.toml").read_text() == before
    fixed = (folder / "setup.fixed.toml").read_text()
    (folder / "setup.toml").write_text(fixed)
    assert read_study(folder).setup.robot.link_lengths_m == (0.254, 0.2667)


def test_a_fit_in_order_is_trusted_and_shows_what_was_measured_twice(folders, tmp_path):
    answer = run("fit", folders["in order"], "--json", tmp_path / "fit.json")
    assert answer.exit_code == 0 and "Method 1 / Method 2" in answer.output and "(!)" not in answer.output
    written = json.loads((tmp_path / "fit.json").read_text())
    assert written["trusted"] is True and written["checks"] == [] and len(written["agreement"]) > 3
