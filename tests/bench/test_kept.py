"""Answers of a bench in their file: taken up by the same code, begun anew by other, whole after a break."""

from pathlib import Path

from kept import Kept


def test_answers_are_there_again_for_the_same_code_alone(tmp_path: Path) -> None:
    code, file = tmp_path / "code.py", tmp_path / "build" / "kept.jsonl"
    code.write_text("a = 1\n")
    Kept(file, [code]).put("1 arm", {"K": [1.0, 2.0]})
    again = Kept(file, [code])
    assert again.answers == {"1 arm": {"K": [1.0, 2.0]}}
    again.put("2 arm", None)
    assert Kept(file, [code]).answers == {"1 arm": {"K": [1.0, 2.0]}, "2 arm": None}
    code.write_text("a = 2\n")
    assert Kept(file, [code]).answers == {}


def test_a_line_cut_off_costs_itself_alone(tmp_path: Path) -> None:
    code, file = tmp_path / "code.py", tmp_path / "kept.jsonl"
    code.write_text("a = 1\n")
    kept = Kept(file, [code])
    for name in ("1", "2"):
        kept.put(name, {"x": 1})
    file.write_text(file.read_text()[:-4])
    after = Kept(file, [code])
    assert after.answers == {"1": {"x": 1}}
    after.put("3", {"x": 3})
    assert Kept(file, [code]).answers == {"1": {"x": 1}, "3": {"x": 3}}
