"""The driver with a stand-in for the tool: a report written by hand, a crash, a silence."""

from __future__ import annotations

import argparse
import json
import sys

import pytest
from independent import judge
from independent.__main__ import main
from independent.harmless import HARMLESS
from independent.laboratory import draw
from independent.table import page

SHORT = next(s for s in range(900, 999) if len(draw(s).plans) == 3)  # three trials of 15 s
REPORT = {
    "format": "impid-diagnosis/1",
    "verdict": "dry friction on joint 1",
    "checks": [],
    "trusted": True,
    "noise_floor": {"tau1": 0.001, "tau2": None, "fx": None, "fy": None},
    "stages": [
        {"added": None},
        {
            "added": {"effect": "friction.coulomb", "where": "joint1", "evidence": {"confidence": 0.97}},
            "validation_rms": {"tau1": 0.002},
            "parameters": {"loads": {}},
        },
    ],
    "unexplained": {"above_noise_floor": False},
    "ambiguous": [],
}


def stand_in(path, body):
    path.write_text(
        f"#!{sys.executable}\nimport sys\nassert sys.argv[1::2] == ['diagnose', '--json'], sys.argv\n{body}\n"
    )
    path.chmod(0o755)
    return str(path)


def lines_of(tmp_path, tool, *options):
    out = tmp_path / "lines.jsonl"
    sys.argv = [
        "independent",
        "judge",
        "--seeds",
        f"{SHORT}:{SHORT}",
        "--out",
        str(out),
        "--tool",
        tool,
        *options,
    ]
    main()
    return out, [json.loads(text) for text in out.read_text().splitlines()]


@pytest.fixture(autouse=True)
def own_arguments(monkeypatch):
    monkeypatch.setattr(sys, "argv", sys.argv)


def test_a_false_alarm_is_counted_and_shown(tmp_path):
    tool = stand_in(tmp_path / "tool", f"open(sys.argv[4], 'w').write({json.dumps(REPORT)!r})")
    out, (line,) = lines_of(tmp_path, tool, "--clean")
    assert line["verdict"] == "false_alarm"
    assert line["named"] == ["friction.coulomb@joint1"]
    assert line["confidences"] == [[0.97, False]]
    assert line["tool"]["status"] == 0
    assert line["tool"]["megabytes"] > 1
    assert line["floors"]["tau1"] > 0
    text = page([out])
    assert "| usual | 1/1 = 100.0 %" in text
    assert "| 0.95 to 0.99 | 0.970 | 0/1 = 0.0 %" in text


def test_a_crash_is_a_failure_and_seeds_are_judged_once(tmp_path):
    tool = stand_in(tmp_path / "tool", "sys.exit('no robot here')")
    _, (line,) = lines_of(tmp_path, tool, "--clean")
    assert line["verdict"] == "failed"
    assert line["tool"]["status"] == 1
    assert line["tool"]["last_words"] == "no robot here"
    assert len(lines_of(tmp_path, tool, "--clean")[1]) == 1


def test_judging_seeds_need_a_word(tmp_path):
    sys.argv = ["independent", "judge", "--seeds", "700000:700000", "--out", str(tmp_path / "x"), "--clean"]
    with pytest.raises(SystemExit, match="--judging"):
        main()


def options(kind, harmless=None):
    return argparse.Namespace(
        clean=False, kind=kind, unusual=False, effect=None, strength=None, harmless=harmless
    )


@pytest.mark.parametrize("kind", ["any", "named", "unnamed", "named2", "unnamed2"])
def test_seeds_run_through_all_effects(kind):
    book = judge.BOOKS[kind]
    seen = {judge.wanted_of(seed, options(kind)).effects[0] for seed in range(4 * len(book))}
    assert len(seen) == 4 * len(book)
    assert {key for key, _ in seen} == set(book)


@pytest.mark.parametrize(("kind", "count"), [("pairs", 2), ("triples", 3), ("clean", 0), ("unusual", 0)])
def test_kinds_of_studies(kind, count):
    wish = judge.wanted_of(5, options(kind))
    assert len({key for key, _ in wish.effects}) == count
    assert wish.unusual == (kind == "unusual")
    assert wish.harmless is None


def test_harmless_kinds_come_in_turn_and_hide_nothing():
    wishes = [judge.wanted_of(seed, options("unusual2")) for seed in range(len(HARMLESS))]
    assert {w.harmless for w in wishes} == set(HARMLESS)
    assert not any(w.effects for w in wishes)
    assert judge.wanted_of(3, options("any", "half_floats")).harmless == "half_floats"


def test_the_table_counts_each_harmless_kind_apart(tmp_path):
    tool = stand_in(
        tmp_path / "tool",
        f"import json, pathlib\npathlib.Path(sys.argv[4]).write_text(json.dumps({REPORT!r}))",
    )
    out, (line,) = lines_of(tmp_path, tool, "--harmless", "half_floats")
    assert line["verdict"] == "false_alarm"
    assert "| half_floats | 1/1 = 100.0 %" in page([out])
