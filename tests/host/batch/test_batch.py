"""The batch on this machine: every study once, whatever happens to one of them or to the whole."""

import datetime
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import impid_host
import pytest
from click.testing import CliRunner
from impid_host.batch.data_set import DataSet
from impid_host.batch.one_study import worked_out
from impid_host.batch.places import place
from impid_host.batch.task import Answer, BatchOptions
from impid_host.batch.worker import Child
from impid_host.cli import cli
from pyarrow import parquet

from tests.host.batch.studies_in_closed_form import Done, batch, stiffness_on, table, write_archive

ROOT = Path(__file__).resolve().parents[3]


def files(out: Path) -> dict[str, tuple[int, int]]:
    """Inode and time of every result: a file that was written again has others."""
    return {path.name: (path.stat().st_ino, path.stat().st_mtime_ns) for path in out.iterdir()}


def blocked(study: Path) -> tuple[Path, str]:
    """A study that takes for ever: a file of it becomes a pipe that nobody writes to. Also what was there."""
    path = study / "free_01" / "trial.toml"
    text = path.read_text()
    path.unlink()
    os.mkfifo(path)
    return path, text


def test_every_number_of_every_study_with_where_it_is_from(done: Done) -> None:
    assert done.outcome.counts == {"fitted": 4}
    whole = table(done.out).to_pylist()
    stiffness = {
        (row["subject"], row["date"].day): row
        for row in whole
        if row["quantity"] == "kxx" and row["method"] == "method1"
    }
    assert sorted(stiffness) == [("P01", 1), ("P01", 2), ("P02", 1), ("P02", 2)]
    for (_, day), row in stiffness.items():
        assert row["value"] == pytest.approx(stiffness_on(day)[0, 0], rel=2e-3)
        assert row["low"] < row["value"] < row["high"]
        assert row["unit"] == "N/m"
        assert row["trusted"]
    row = stiffness["P02", 2]
    assert row["place"] == str(done.archive / "P02" / "day2")
    assert row["date"] == datetime.date(2026, 11, 2)
    assert (row["impid"], row["python"].split(".")[0]) == (impid_host.__version__, "3")
    assert len(row["data_sha256"]) == 64
    assert json.loads(row["options"]) == {"diagnose": False, "terms": []}
    loads = impid_host.fit(done.archive / "P02" / "day2").loads["spring"]["method1"]
    assert row["value"] == pytest.approx(loads["K"]["value"][0][0], rel=1e-9)
    assert [row["low"], row["high"]] == pytest.approx(loads["K"]["ci95"][0][0], rel=1e-6)


def test_what_is_done_is_not_done_again(done: Done, tmp_path: Path) -> None:
    """By the hash of the data: neither a new time stamp, nor another place, nor a copy is new data."""
    before = files(done.out)
    for path in done.archive.rglob("*.csv"):
        path.touch()
    assert batch(done.archive, done.out).counts == {"done before": 4}
    shutil.copytree(done.archive, tmp_path / "moved")
    shutil.copytree(done.archive / "P01" / "day1", tmp_path / "moved" / "copy")
    assert batch(tmp_path / "moved", done.out).counts == {"done before": 5}
    assert files(done.out) == before


def test_new_data_and_new_options_replace_the_result(tmp_path: Path) -> None:
    out, archive = tmp_path / "out", tmp_path / "archive"
    write_archive(archive, 1, 2)
    shutil.copytree(archive / "P01" / "day1", archive / "P01" / "day1_copy")
    batch(archive, out)
    before = files(out)
    assert len(before) == 2  # a copy is no second study
    shutil.rmtree(archive / "P01" / "day1_copy")
    log = archive / "P01" / "day2" / "spring_01" / "robot.csv"
    log.write_text("".join(log.read_text().splitlines(keepends=True)[:-100]))
    outcome = batch(archive, out)
    assert (outcome.counts, outcome.superseded) == ({"done before": 1, "fitted": 1}, 1)
    assert len(files(out)) == 2
    assert len(files(out).items() & before.items()) == 1
    friction = BatchOptions(terms=("friction.coulomb",))
    outcome = batch(archive, out, options=friction)
    assert (outcome.counts, outcome.superseded) == ({"fitted": 2}, 2)
    assert {row["options"] for row in table(out).to_pylist()} == {friction.to_json()}
    assert "Fc1" in {row["quantity"] for row in table(out).to_pylist()}


def test_a_study_that_cannot_be_reached_keeps_its_result(done: Done, tmp_path: Path) -> None:
    """The disk is not there today: it is said, and yesterday's numbers stay."""
    out = tmp_path / "out"
    shutil.copytree(done.out, out)
    gone = Answer(str(done.archive / "P01" / "day1"), "unreadable", why="gone")
    results = DataSet(place(out))
    results.add(gone, BatchOptions(), "")
    assert results.drop_superseded() == 0
    assert table(out).equals(table(done.out))


def test_a_broken_study_harms_no_other(archive: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    log = archive / "P01" / "day1" / "free_01" / "robot.csv"
    whole = log.read_text()
    lines = whole.splitlines()
    (tmp_path / "empty").mkdir()
    log.write_text("\n".join([*lines[:7], "garbage,1,2", *lines[8:]]))
    done = CliRunner().invoke(
        cli,
        [
            "batch",
            str(archive),
            str(tmp_path / "gone"),
            str(tmp_path / "empty"),
            "--out",
            str(out),
            "--jobs",
            "1",
        ],
    )
    assert done.exit_code == 1, done.output
    assert "1 bad data, 3 fitted, 2 unreadable" in done.output
    assert f"{archive / 'P01' / 'day1'}: bad data: {log}, row 8: " in done.output
    assert "complete or delete that row" in done.output
    assert f"{tmp_path / 'gone'}: does not exist; give study folders" in done.output
    assert f"{tmp_path / 'empty'}: holds no study; give folders that hold setup.toml" in done.output
    row = next(row for row in table(out).to_pylist() if row["status"] == "bad data")
    assert (row["value"], row["study"], row["trusted"]) == (None, "day1", False)
    assert "row 8" in row["why"]
    assert "complete or delete" in row["remedy"]
    log.write_text(whole)
    outcome = batch(archive, out)
    assert outcome.counts == {"done before": 3, "fitted": 1}
    assert {row["status"] for row in table(out).to_pylist() if row["place"].startswith(str(archive))} == {
        "fitted"
    }


def test_a_study_that_takes_too_long_is_ended(archive: Path, tmp_path: Path) -> None:
    blocked(archive / "P01" / "day1")
    outcome = batch(archive, tmp_path / "out", timeout_s=10.0)
    assert outcome.counts == {"fitted": 3, "timed out": 1}
    (late,) = outcome.broken
    assert late.place == str(archive / "P01" / "day1")
    assert (late.why, late.remedy) == ("took more than 10 s", "give more time with --timeout")
    assert len(late.data_sha256) == 64


def test_a_study_that_kills_its_process_harms_no_other(archive: Path, tmp_path: Path) -> None:
    """Killed as a system does that runs out of memory, while it reads the study."""
    pipe, text = blocked(archive / "P01" / "day1")
    me = os.getpid()

    def kill() -> None:
        writer = os.open(pipe, os.O_WRONLY)  # waits until the process has opened it
        os.kill(next(child for child in children_of(me)), signal.SIGKILL)
        os.close(writer)

    killer = threading.Thread(target=kill)
    killer.start()
    outcome = batch(archive, tmp_path / "out")
    killer.join()
    pipe.unlink()
    pipe.write_text(text)
    assert outcome.counts == {"crashed": 1, "fitted": 3}
    assert outcome.broken[0].why.startswith("the process ended by SIGKILL")
    assert "out of memory" in outcome.broken[0].remedy
    assert batch(archive, tmp_path / "out").counts == {"done before": 3, "fitted": 1}


def children_of(parent: int) -> list[int]:
    """Processes that work on studies for this one."""
    found = []
    for own in Path("/proc").glob("[0-9]*"):
        try:
            words = (own / "cmdline").read_bytes().split(b"\0")
            above = int((own / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        if above == parent and b"impid_host.batch.child" in words:
            found.append(int(own.name))
    return found


def test_a_process_that_died_between_two_studies(archive: Path) -> None:
    """Nobody reads the next request: it is a crash like any other, and the one after it is worked on."""
    child, study = Child(), str(archive / "P01" / "day1")
    try:
        first = child.answer(study, BatchOptions(), frozenset(), 60.0)
        (pid,) = children_of(os.getpid())
        os.kill(pid, signal.SIGKILL)
        while Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
            time.sleep(0.01)
        second, third = (child.answer(study, BatchOptions(), frozenset(), 60.0) for _ in range(2))
    finally:
        child.close()
    assert [own.status for own in (first, second, third)] == ["fitted", "crashed", "fitted"]
    assert second.why.startswith("the process ended by SIGKILL")


def test_a_defect_is_told_with_its_place(archive: Path) -> None:
    """Whatever a study sets off within impid is an answer that says where, and no end of the process."""
    first = Answer("study", "fitted", "key", study="study")
    answer = worked_out(first, 17, BatchOptions())  # type: ignore[arg-type]
    assert answer.status == "crashed"
    assert answer.why.startswith("TypeError: ")
    assert "folder.py, line " in answer.why
    assert "`impid-host fit study` shows it whole" in answer.remedy


def test_after_a_kill_the_same_command_goes_on(tmp_path: Path) -> None:
    """The whole batch is killed in the middle: what was finished stays as it is, the rest is done."""
    out = tmp_path / "out"
    write_archive(tmp_path / "archive", 3, 3)
    code = "from impid_host.cli import main; main()"
    command = [
        sys.executable,
        "-c",
        code,
        "batch",
        str(tmp_path / "archive"),
        "--out",
        str(out),
        "--jobs",
        "1",
    ]
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'host'}{os.pathsep}{ROOT}"}
    with subprocess.Popen(
        command, env=environment, stderr=subprocess.PIPE, stdout=subprocess.PIPE
    ) as running:
        ends = time.monotonic() + 120
        while not (out.is_dir() and len(list(out.glob("*.parquet"))) >= 2):
            assert time.monotonic() < ends
            assert running.poll() is None
            time.sleep(0.02)
        children = children_of(running.pid)
        running.kill()
    assert len(children) == 1
    before = files(out)
    ends = time.monotonic() + 20
    while Path(f"/proc/{children[0]}/cmdline").exists() and time.monotonic() < ends:
        time.sleep(0.05)
    assert not Path(f"/proc/{children[0]}/cmdline").exists()  # it ends with its parent
    outcome = batch(tmp_path / "archive", out)
    finished = {name for name in before if not name.startswith(".")}
    assert 2 <= len(finished) < 9
    assert outcome.counts == {"done before": len(finished), "fitted": 9 - len(finished)}
    after = files(out)
    assert {name: after[name] for name in finished} == {name: before[name] for name in finished}
    places = [row["place"] for row in table(out).to_pylist() if row["quantity"] == "kxx"]
    assert len(places) == len(set(places)) == 9


def test_a_process_goes_on_with_the_next_study(archive: Path) -> None:
    child = Child()
    try:
        known: frozenset[str] = frozenset()
        study = str(archive / "P01" / "day1")
        first = child.answer(study, BatchOptions(), known, 60.0)
        again = child.answer(study, BatchOptions(), frozenset({first.key}), 60.0)
        third = child.answer(study, BatchOptions(), known, 60.0)
    finally:
        child.close()
    assert [first.status, again.status, third.status] == ["fitted", "done before", "fitted"]
    assert first.rows == third.rows


def test_compare_reads_the_results(done: Done) -> None:
    """The same changes as from the studies themselves, and nothing is fitted."""
    studies = [str(path.parent) for path in sorted(done.archive.rglob("setup.toml"))]
    said = [CliRunner().invoke(cli, ["compare", *of, "--json", "-"]) for of in (studies, [str(done.out)])]
    assert [one.exit_code for one in said] == [0, 0], said[1].output
    fitted, read = (json.loads(one.stdout)["series"] for one in said)
    assert len(read) == len(fitted) == 12
    for theirs, ours in zip(sorted(fitted, key=_what), sorted(read, key=_what), strict=True):
        assert ours["changes"][0]["value"] == pytest.approx(theirs["changes"][0]["value"], rel=1e-9)
        assert ours["occasions"][0]["studies"] == theirs["occasions"][0]["studies"]
    (kxx,) = (s["changes"][0] for s in read if s["quantity"] == "kxx" and s["subject"] == "P01")
    assert kxx["value"] == pytest.approx(40.0, abs=0.5)
    twice = CliRunner().invoke(cli, ["compare", str(done.out), studies[0]])
    assert twice.exit_code == 1
    assert f"{studies[0]}: is given twice" in str(twice.exception)


def _what(series) -> tuple[str, str]:
    return series["subject"], series["quantity"]


def test_the_long_table_is_read_as_well(done: Done, tmp_path: Path) -> None:
    out, long = done.out, tmp_path / "all.parquet"
    assert CliRunner().invoke(cli, ["compare", str(out), "--table", str(long)]).exit_code == 0
    said = [CliRunner().invoke(cli, ["compare", str(of), "--json", "-"]).stdout for of in (out, long)]
    assert said[0] == said[1]
    strange = tmp_path / "strange.parquet"
    parquet.write_table(parquet.read_table(long).drop_columns(["sd"]), strange)
    refused = CliRunner().invoke(cli, ["compare", str(strange)])
    assert (refused.exit_code, "has no column sd" in str(refused.exception)) == (1, True)


def test_studies_within_a_study_are_not_looked_for(archive: Path) -> None:
    shutil.copytree(archive / "P02" / "day2", archive / "P01" / "day1" / "old")
    found = place(archive).studies()
    assert found == [str(archive / who / day) for who in ("P01", "P02") for day in ("day1", "day2")]
