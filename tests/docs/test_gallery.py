"""Every example of the gallery runs, prints and draws; its pages say what it did."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
import gallery  # noqa: E402

SIMULATED = [path for path in gallery.paths() if not path.stem.startswith("measured")]
MEASURED = ROOT / "docs" / "gallery" / "measured_drive.py"


def test_there_are_five_short_ones_and_each_is_linked() -> None:
    paths = gallery.paths()
    assert len(paths) == 5
    index = (ROOT / "docs" / "gallery" / "index.md").read_text(encoding="utf-8")
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    for path in paths:
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 60
        assert f"({path.name})" in index
        assert f"gallery/{path.stem}.md" in navigation


@pytest.mark.parametrize("path", SIMULATED, ids=lambda path: path.stem)
def test_an_example_runs(path: Path) -> None:
    example = gallery.run(path)
    assert example.pictures
    for picture in example.pictures.values():
        assert picture.startswith(b"\x89PNG")
        assert len(picture) > 10_000
    page = example.page()
    assert page.startswith(f"# {example.title}\n")
    for name in example.pictures:
        assert f"]({name})" in page
    assert "```text\n" in page
    shown = ROOT / "docs" / "img" / "gallery" / f"{path.stem}.png"
    assert shown.exists(), "run scripts/gallery.py"


def test_what_the_examples_say_is_so() -> None:
    """The friction and the push that the examples put in are the ones that they report."""
    push = gallery.run(ROOT / "docs" / "gallery" / "push.py").page()
    assert "'trial': 'spring_01', 'begin_s': 8.0, 'end_s': 10.0" in push
    lacking = gallery.run(ROOT / "docs" / "gallery" / "undeclared_effect.py").page()
    assert "friction.coulomb on joint1" in lacking


def test_the_measured_one_says_when_its_record_is_absent(monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setenv("IMPID_DATA", str(tmp_path))
    example = gallery.run(MEASURED)
    assert "The measured record is absent" in example.page()
    assert example.pictures == {}


@pytest.mark.measured
def test_the_measured_one_finds_the_published_mass(measured_data: Path, monkeypatch) -> None:
    monkeypatch.setitem(os.environ, "IMPID_DATA", str(measured_data))
    example = gallery.run(MEASURED)
    assert "with dry friction and offset: M 95.0" in example.page()
    assert len(example.pictures) == 1


def test_a_cell_shows_what_it_prints_what_it_draws_and_its_last_value(tmp_path: Path) -> None:
    path = tmp_path / "small.py"
    path.write_text(
        '"""Title\n\nOpening."""\n\nclass T:\n    def _repr_html_(self):\n        return "<b>table</b>"\n\n'
        "print(1 + 1)\nT()\n\n# %% A sentence.\n\nimport matplotlib.pyplot as plt\nplt.plot([1, 2])\n"
    )
    first, second = gallery.run(path).cells
    assert (first.printed, first.shown, first.pictures) == ("2\n", "<b>table</b>", ())
    assert second.words == "A sentence."
    assert len(second.pictures) == 1


def test_an_example_that_fails_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "broken.py"
    path.write_text('"""Title."""\n\nraise ValueError("no")\n')
    with pytest.raises(ValueError, match="no"):
        gallery.run(path)
