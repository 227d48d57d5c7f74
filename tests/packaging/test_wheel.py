"""The wheel, built from what is tracked and used away from the checkout."""

import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BASE_IS_ABOUT = 12
# Python, then the script, with every distribution hidden that the base does not bring.
HIDDEN = """
import runpy, sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {hidden!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Refuse())
runpy.run_path({script!r}, run_name="__main__")
"""
OPTIONAL = ("cffi", "_cffi_backend", "unicorn", "elftools", "can", "cantools", "pint", "simpleeval", "pandas")


def run(command: list[str], **more: str) -> subprocess.CompletedProcess[str]:
    """A program without anything of this checkout on its path."""
    clean = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "IMPID_SIM")}
    return subprocess.run(
        command, capture_output=True, text=True, check=False, env=clean | more, cwd=ROOT.parent
    )


def wheel_of(folder: Path, **more: str) -> Path:
    """Built from a copy of the tracked files, so that nothing of it lands in the checkout."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    source = folder / "source"
    for name in filter(None, listed.stdout.split("\0")):
        if (ROOT / name).is_file() and not name.startswith(("tests/", "bench/", "docs/")):
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, source / name)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--no-deps"]
    done = run([*pip, "--no-build-isolation", "--wheel-dir", str(folder), str(source)], **more)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return wheel_of(tmp_path_factory.mktemp("wheel"), IMPID_SIM="1")


def installed(wheel: Path, folder: Path) -> Path:
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(folder)
    return folder


def test_one_wheel_serves_every_python_from_the_oldest_on(wheel: Path) -> None:
    assert "-cp311-abi3-" in wheel.name
    names = zipfile.ZipFile(wheel).namelist()
    compiled = {Path(name).name.partition(".")[0] for name in names if name.endswith((".so", ".pyd"))}
    assert {"_native", "_chip"} <= compiled
    pages = ("impid_host/view/page.html", "impid_host/report/page/page.html.jinja")
    assert {*pages, "hil_sim/board/impid.dbc"} <= set(names)


def test_what_is_installed_fits_and_simulates(wheel: Path, tmp_path: Path) -> None:
    site = installed(wheel, tmp_path / "site")
    done = run([sys.executable, str(ROOT / "tests/packaging/installed.py")], PYTHONPATH=str(site))
    assert done.returncode == 0, done.stderr[-2000:]
    assert str(site) in done.stdout


def test_without_a_compiler_and_without_extras_the_host_still_fits(tmp_path: Path) -> None:
    wheel = wheel_of(tmp_path, CC="no-such-compiler")
    site = installed(wheel, tmp_path / "site")
    assert not list(site.rglob("*.so"))
    code = HIDDEN.format(hidden=set(OPTIONAL), script=str(ROOT / "tests/packaging/installed.py"))
    done = run([sys.executable, "-c", code], PYTHONPATH=str(site))
    assert done.returncode == 0, done.stderr[-2000:]


def test_the_base_is_small() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert len(project["dependencies"]) <= BASE_IS_ABOUT


def test_the_lock_names_every_package_that_the_project_asks_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    pinned = {line.partition("==")[0].lower().replace("_", "-") for line in lock.splitlines() if "==" in line}
    extras = project["optional-dependencies"]
    asked = [
        *project["dependencies"],
        *(one for name, own in extras.items() if name != "bench" for one in own),
    ]
    names = {one.split(">")[0].split("[")[0].lower().replace("_", "-") for one in asked} - {"impid"}
    assert names <= pinned, names - pinned
    assert "://" not in lock
