"""The site builds without a network, is whole, and fetches nothing when it is read."""

import os
import re
import subprocess
import sys
from pathlib import Path

import cantools
import pytest
from impid_host import __all__ as public
from impid_host.cli import COMMANDS
from impid_host.effects.catalogue import CATALOGUE

ROOT = Path(__file__).resolve().parents[2]
# What a browser loads by itself; links that a reader may follow are others.
_LOADED = re.compile(r"""<(?:script|img|link|iframe)[^>]+?(?:src|href)=["']?(https?:)?//[^"'>\s]+""")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site; mkdocs.yml makes warnings errors."""
    out = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", str(out)],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": f"{ROOT / 'host'}{os.pathsep}{ROOT}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def test_nothing_is_fetched(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 40
    for page in pages:
        assert _LOADED.search(page.read_text(encoding="utf-8")) is None, page.name
    for sheet in site.rglob("*.css"):
        assert re.search(r"url\(['\"]?https?:", sheet.read_text(encoding="utf-8")) is None, sheet.name


def test_what_a_browser_loads_is_seen() -> None:
    assert _LOADED.search('<script defer src="https://somewhere/x.js">')
    assert _LOADED.search('<a href="https://somewhere/">') is None


def test_links_and_pictures_are_there(site: Path) -> None:
    wrong = [
        f"{page.name}: {target}"
        for page in site.rglob("*.html")
        if page.name != "404.html"  # its links are for a server's root
        for target in re.findall(r'(?:src|href)="(?!https?:|data:)([^"#]+)', page.read_text(encoding="utf-8"))
        if not (page.parent / target).exists()
    ]
    assert wrong == []


def test_reference_is_whole(site: Path) -> None:
    commands = (site / "reference" / "commands.html").read_text(encoding="utf-8")
    assert [name for name in COMMANDS if f'id="impid-host-{name}"' not in commands] == []
    names = (site / "reference" / "python.html").read_text(encoding="utf-8")
    assert [name for name in public if not name.startswith("_") and f'.{name}"' not in names] == []
    effects = (site / "reference" / "effects.html").read_text(encoding="utf-8")
    assert [name for name in CATALOGUE if f">{name}<" not in effects] == []
    messages = (site / "reference" / "messages.html").read_text(encoding="utf-8")
    database = cantools.database.load_file(ROOT / "protocol" / "impid.dbc")
    signals = [signal.name for message in database.messages for signal in message.signals]
    assert signals
    assert [name for name in signals if f">{name}<" not in messages] == []
