"""Sessions side by side: truth by hand, coverage by chance, the command as a user calls it."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from impid_host.cli import cli
from impid_host.errors import ImpidError
from impid_host.sessions.change import compare, repeatability
from impid_host.sessions.long_table import common_session
from impid_host.sessions.row import Row
from impid_host.sessions.shown import over_time
from impid_host.study.folder import write_study
from impid_host.study.model import Session
from pyarrow import parquet

from tests.host.report.small_study import K, study


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments], catch_exceptions=False)


def row(
    name: str, date: str, value: float, sd: float = 1.0, side: str = "left", quantity: str = "kxx"
) -> Row:
    ends = (value - 1.96 * sd, value + 1.96 * sd)
    return Row(name, "P07", side, date, "", "arm", "method1", quantity, value, *ends, sd, "N/m", True)


def test_a_change_by_hand() -> None:
    """Two repeats on each of two days: S^2 = (2 + 8) / 2 = 5, tau^2 = 4, of two occasions of two sessions."""
    rows = [
        row("a", "2026-11-02", 99),
        row("b", "2026-11-02", 101),
        row("c", "2026-11-09", 118),
        row("d", "2026-11-09", 122),
    ]
    (own,) = compare(rows)
    assert own.repeatability is not None
    assert own.repeatability.dof == 2
    assert own.repeatability.tau == pytest.approx(2.0)
    assert own.repeatability.sem == pytest.approx(np.sqrt(5))
    t = 4.302652729911275  # of two degrees of freedom, from a table
    assert own.repeatability.mdc95 == pytest.approx(t * np.sqrt(2 * 5))
    (change,) = own.changes
    assert (change.value, change.percent) == (20, 20)
    assert change.high - change.value == pytest.approx(t * np.sqrt(5))
    assert change.clear


def test_without_repeats_nothing_is_called_a_change() -> None:
    (own,) = compare([row("a", "2026-11-02", 100), row("b", "2026-11-09", 200)])
    assert own.repeatability is None
    assert own.changes[0].clear is None
    assert own.changes[0].high - 100 == pytest.approx(1.959964 * np.sqrt(2))
    (steady,) = compare([row("a", "2026-11-02", 100), row("b", "2026-11-09", 104)], steady=True)
    assert steady.repeatability is not None
    assert steady.repeatability.dof == 1
    assert steady.repeatability.sem == pytest.approx(np.sqrt(8))


def test_what_is_not_alike_is_not_compared() -> None:
    rows = [
        row("a", "2026-11-02", 100),
        row("b", "2026-11-09", 100, side="right"),
        row("b", "2026-11-09", 5, quantity="m"),
    ]
    assert compare(rows) == []
    assert repeatability([]) is None


@pytest.mark.parametrize("tau", [0.0, 0.5, 3.0])
def test_intervals_hold_the_change_as_often_as_they_say(tau: float) -> None:
    """2000 campaigns of two days with three sessions each; the change is 7, the noise 1."""
    rng = np.random.default_rng(5)
    held = 0
    for _ in range(2000):
        values = np.repeat([100.0, 107.0], 3) + rng.normal(0, tau, 6) + rng.normal(0, 1.0, 6)
        days = ["2026-11-02"] * 3 + ["2026-11-09"] * 3
        (own,) = compare(
            [row(f"s{k}", day, value) for k, (day, value) in enumerate(zip(days, values, strict=True))]
        )
        held += own.changes[0].low <= 7.0 <= own.changes[0].high
    # Where mounting adds nothing the interval is somewhat too wide: t of few degrees of freedom.
    assert 0.94 <= held / 2000 <= (0.97 if tau > 1 else 1.0)


def test_days_follow_the_calendar_and_their_bars_the_noise() -> None:
    (own,) = compare(
        [row("late", "2026-11-30", 3), row("early", "2026-11-02", 1), row("again", "2026-11-02", 2)]
    )
    assert [one.date for one in own.occasions] == ["2026-11-02", "2026-11-30"]
    assert own.changes[0].value == pytest.approx(1.5)
    plot = over_time([own])[0]
    assert plot.lines[0].x.tolist() == [0.0, 28.0]
    bars, dots = plot.lines[1:3]
    assert bars.y[:2] == pytest.approx([3 - 1.96, 3 + 1.96])
    assert (dots.x.tolist(), dots.y.tolist()) == ([28.0, 0.0, 0.0], [3.0, 1.0, 2.0])


def test_a_session_is_what_its_trials_have_in_common() -> None:
    own = study("s", day=3)
    first, *rest = own.trials
    other = replace(own, trials=(replace(first, session=Session(posture="seated", side="right")), *rest))
    names = [trial.name for trial in own.trials]
    assert common_session(other, names[:1]) == Session("P<07>", "right", own.setup.session.date, "seated")
    assert common_session(other, names) == Session("P<07>", None, own.setup.session.date, None)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two sessions on the 2nd and 9th each; K grows by a tenth between the days, by 2 % from mounting."""
    place = tmp_path_factory.mktemp("campaign")
    plan = [("one/study", 2, 1.0), ("two/study", 2, 1.02), ("three", 9, 1.1), ("four", 9, 1.12)]
    return [
        write_study(study("s", stiffness=K * factor, day=day, seed=10 * k + 1), place / name)
        for k, (name, day, factor) in enumerate(plan)
    ]


def test_the_command(campaign: list[Path], tmp_path: Path) -> None:
    table = tmp_path / "all.csv"
    done = run(
        "compare", *campaign, "--table", table, "--json", tmp_path / "c.json", "--figures", tmp_path / "f"
    )
    assert done.exit_code == 0, done.output
    document = json.loads((tmp_path / "c.json").read_text())
    kxx = next(own for own in document["series"] if own["quantity"] == "kxx")
    assert [one["date"] for one in kxx["occasions"]] == ["2026-11-02", "2026-11-09"]
    assert kxx["occasions"][0]["studies"] == ["one/study", "two/study"]
    change = kxx["changes"][0]
    truth = 0.1 * K[0, 0]
    assert change["ci95"][0] < truth < change["ci95"][1]
    assert change["value"] == pytest.approx(truth, rel=0.05)
    # The scatter of repeats is 1 % to either side, far above the noise of a fit.
    assert kxx["repeatability"]["sem"] == pytest.approx(0.02 * K[0, 0] / np.sqrt(2), rel=0.2)
    assert "changed" in done.output
    assert (tmp_path / "f" / "sessions_P-07-_left_spring_method1_kxx.pdf").exists()
    with table.open() as text:
        rows = list(csv.DictReader(text))
    assert {own["study"] for own in rows} == {"one/study", "two/study", "three", "four"}
    assert {own["subject"] for own in rows} == {"P<07>"}
    stiff = [float(own["value"]) for own in rows if own["quantity"] == "kxx"]
    assert stiff == pytest.approx([400, 408, 440, 448], rel=0.01)


def test_one_study_is_enough_for_a_table_and_parquet_says_the_same(
    campaign: list[Path], tmp_path: Path
) -> None:
    assert run("compare", campaign[2], "--table", tmp_path / "t.parquet").exit_code == 0
    assert run("compare", campaign[2], "--table", tmp_path / "t.csv").exit_code == 0
    read = parquet.read_table(tmp_path / "t.parquet").to_pylist()
    with (tmp_path / "t.csv").open() as text:
        written = list(csv.DictReader(text))
    assert [str(own["value"]) for own in read] == [own["value"] for own in written]
    assert all(own["trusted"] is True for own in read)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--table", "x.xlsx"], "name it .csv or .parquet"),
        ([], "no two studies measured one load"),
    ],
)
def test_refusals(campaign: list[Path], more: list[str], words: str) -> None:
    done = CliRunner().invoke(cli, ["compare", str(campaign[2]), *more])
    assert done.exit_code == 1
    assert isinstance(done.exception, ImpidError)
    assert words in str(done.exception)


def test_the_same_study_twice_is_refused(campaign: list[Path]) -> None:
    done = CliRunner().invoke(cli, ["compare", str(campaign[2]), str(campaign[2])])
    assert isinstance(done.exception, ImpidError)
    assert "given twice" in str(done.exception)


def test_a_report_of_several_studies_begins_with_what_changed(campaign: list[Path], tmp_path: Path) -> None:
    done = run("report", campaign[0], campaign[2], "--no-diagnose", "--out", tmp_path / "r.html")
    assert done.exit_code == 0, done.output
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    headings = re.findall(r"<h[12]>([^<]*)</h[12]>", text)
    assert headings[0] == "Sessions side by side"
    assert [name for name in headings if name in ("study", "three")] == ["study", "three"]
    assert "no repeats: unknown" in text
    assert "subject P&lt;07&gt;, side left, date 2026-11-02" in text


def test_results_carry_their_session(campaign: list[Path]) -> None:
    document = json.loads(run("fit", campaign[0], "--json", "-").output)
    own = {"subject": "P<07>", "side": "left", "date": "2026-11-02", "posture": None}
    assert document["sessions"] == dict.fromkeys(["free_01", "free_02", "spring_01"], own)
