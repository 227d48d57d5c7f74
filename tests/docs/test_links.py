"""Every relative link of README and docs leads to a file, and every anchor to a heading. No network."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(
    [
        *ROOT.glob("*.md"),
        *(ROOT / "docs").rglob("*.md"),
        *(ROOT / "firmware").rglob("*.md"),
    ]
)
_FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
_CODE = re.compile(r"`[^`\n]*`")
_LINK = re.compile(r"\]\(([^)\s]+)\)")


def headings(text: str) -> set[str]:
    """Anchors of a page, as GitHub and mkdocs make them."""
    found = re.findall(r"^#+ +(.+)$", _FENCE.sub("", text), re.MULTILINE)
    return {re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", title).strip().lower()) for title in found}


def broken(page: Path, text: str) -> list[str]:
    """Targets of a page's links that are not there."""
    wrong = []
    for target in _LINK.findall(_CODE.sub("", _FENCE.sub("", text))):
        if "://" in target or target.startswith("mailto:"):
            continue
        path, _, anchor = target.partition("#")
        aim = (page.parent / path).resolve() if path else page
        if not aim.exists() or (anchor and anchor not in headings(aim.read_text(encoding="utf-8"))):
            wrong.append(target)
    return wrong


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page: Path) -> None:
    assert broken(page, page.read_text(encoding="utf-8")) == []


def test_broken_links_are_found(tmp_path: Path) -> None:
    (tmp_path / "there.md").write_text("# A heading, with *signs*: 1.5\n")
    page = tmp_path / "page.md"
    text = (
        "[a](there.md) [b](there.md#a-heading-with-signs-15) [c](gone.md) [d](there.md#gone) `[e](gone.md)`"
    )
    assert broken(page, text) == ["gone.md", "there.md#gone"]


def test_every_page_is_looked_at() -> None:
    assert len(PAGES) > 40
