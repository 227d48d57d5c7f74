"""What is installed where: no links, a host that needs no simulator, a simulator that imports on Windows."""

import json
import os
import re
import socket
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# A finder, before all others, that refuses what an installation does not have, and to our own modules what
# a system does not have: on this one, libraries need it.
REFUSE = """
import sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        frame = sys._getframe(1)
        while "importlib" in frame.f_code.co_filename:
            frame = frame.f_back
        ours = any(part in frame.f_code.co_filename for part in ("impid_host", "hil_sim"))
        if {{name, name.partition(".")[0]}} & {missing!r} or (ours and name in {posix!r}):
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Refuse())
"""
POSIX_ONLY = ("tty", "termios", "pty", "fcntl", "resource", "grp", "pwd")
OF_THE_SIMULATOR = ("hil_sim", "cffi", "_cffi_backend", "unicorn", "elftools")
OF_THE_BATCH = ("distributed", "fsspec", "s3fs", "sshfs", "duckdb")
ENVIRONMENT = {**os.environ, "PYTHONPATH": f"{ROOT / 'host'}{os.pathsep}{ROOT}"}
BATCH = (
    "from impid_host.cli import main\n"
    "sys.argv = ['impid-host', 'batch', '{studies}', '--out', 'results-of-nothing', *{more}]\nmain()"
)
OPTIONAL = (
    *OF_THE_SIMULATOR,
    *OF_THE_BATCH,
    *("aiohttp", "asammdf", "can", "cantools", "ezc3d", "h5py", "msgpack", "pandas", "pinocchio"),
    *("pint", "pyxdf", "rosbags", "simpleeval", "xarray"),
)
# What drives an optional library by design.
DRIVERS = {
    "impid_host.view.server",
    "impid_host.link.can_bus",
    "impid_host.recording.export.can_log",
    "impid_host.wire.native_build",
}


def command(code: str, missing: tuple[str, ...] = (), posix: tuple[str, ...] = ()) -> list[str]:
    """A Python that runs code without the named modules."""
    return [sys.executable, "-c", REFUSE.format(missing=set(missing), posix=set(posix)) + code]


def python(
    code: str, missing: tuple[str, ...] = (), posix: tuple[str, ...] = ()
) -> subprocess.CompletedProcess[str]:
    """Run it to its end."""
    return subprocess.run(
        command(code, missing, posix),
        capture_output=True,
        text=True,
        env=ENVIRONMENT,
        timeout=240,
        check=False,
    )


def modules(folder: str, package: str) -> list[str]:
    """Every module of a package by its name."""
    root = ROOT / folder
    found = [path.relative_to(root).with_suffix("") for path in sorted((root / package).rglob("*.py"))]
    return [".".join(path.parts).removesuffix(".__init__") for path in found]


def test_there_is_no_link_in_the_tree() -> None:
    listed = subprocess.run(["git", "ls-files", "-s"], cwd=ROOT, capture_output=True, text=True, check=True)
    entries = [line for line in listed.stdout.splitlines() if line]
    assert len(entries) > 500
    assert [line for line in entries if line.startswith("120000")] == []


def test_the_simulator_reads_the_dbc_of_the_protocol() -> None:
    one = (ROOT / "protocol" / "impid.dbc").read_bytes()
    assert (ROOT / "hil_sim/board/impid.dbc").read_bytes() == one, "run scripts/generate_protocol.py"


def test_every_module_of_the_host_imports_without_extras_and_on_windows() -> None:
    wanted = [name for name in modules("host", "impid_host") if name not in DRIVERS]
    code = f"import os, importlib\nfor n in {wanted}: importlib.import_module(n)\nprint(len({wanted}))"
    done = python(code, OPTIONAL, POSIX_ONLY)
    assert done.returncode == 0, done.stderr[-2000:]
    assert int(done.stdout) > 200


def test_every_module_of_the_simulator_imports_on_windows() -> None:
    builders = ("hil_sim.native_build", "hil_sim.board.elf.chip_build")
    wanted = [name for name in modules(".", "hil_sim") if name not in builders]
    code = (
        "import os\nfor name in ('openpty', 'ttyname', 'fork'): hasattr(os, name) and delattr(os, name)\n"
        f"import importlib\nfor n in {wanted}: importlib.import_module(n)\n"
        "from hil_sim.serve.connect import DEFAULT_CARRIER\nprint(DEFAULT_CARRIER)"
    )
    done = python(code, posix=POSIX_ONLY)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.strip() == "tcp"


def test_the_simulator_serves_tcp_where_there_are_no_terminals() -> None:
    serve = (
        "import os, sys\nfor name in ('openpty', 'ttyname'): delattr(os, name)\n"
        "from hil_sim.cli import main\n"
        "sys.argv = ['impid-sim', 'serve', 'first-light', '--until-stdin-closes', *{more}]\nmain()"
    )
    refused = python(
        serve.format(more=["--carrier", "pty"]).replace(", '--until-stdin-closes'", ""), posix=POSIX_ONLY
    )
    assert refused.returncode == 1
    assert refused.stderr.strip() == "impid-sim: this system has no pseudo-terminals; use --carrier tcp"
    with subprocess.Popen(
        command(serve.format(more=[]), posix=POSIX_ONLY),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=ENVIRONMENT,
    ) as running:
        assert running.stdout is not None
        assert running.stdin is not None
        ready = json.loads(running.stdout.readline())
        found = re.fullmatch(r"socket://127\.0\.0\.1:(\d+)", ready["port"])
        assert found is not None
        with socket.create_connection(("127.0.0.1", int(found[1])), timeout=20):
            pass
        running.stdin.close()
        assert running.wait(60) == 0
    assert (ready["event"], ready["carrier"]) == ("ready", "tcp")


@pytest.mark.parametrize(
    ("code", "missing", "words"),
    [
        (
            "from hil_sim.cli import main\n"
            "sys.argv = ['impid-sim', 'study', 'first-light', '--out', 'x']\nmain()",
            "hil_sim._native",
            "impid-sim: hil_sim._native is missing: the simulator is an extra; pip install 'impid[sim]'",
        ),
        (
            "from impid_host import example_study\ntry: example_study().to_pandas()\n"
            "except ImportError as e: raise SystemExit(str(e))",
            "pandas",
            "a data frame needs pandas: pip install 'impid[pandas]'",
        ),
        (
            "from pathlib import Path\nfrom impid_host.study.mat_log import Hdf5Log\n"
            "try: Hdf5Log(Path('a.mat'))\nexcept Exception as e: raise SystemExit(str(e))",
            "h5py",
            "a.mat (MATLAB 7.3, HDF5) needs h5py: pip install 'impid[mat]'",
        ),
        (
            BATCH.format(studies="s3://clinic/archive", more=[]),
            "fsspec",
            "s3://clinic/archive: an address needs fsspec: pip install 'impid[batch]'",
        ),
        (
            BATCH.format(studies="s3://clinic/archive", more=[]),
            "s3fs",
            "s3://clinic/archive: s3 needs s3fs: pip install 'impid[batch]'",
        ),
        (
            BATCH.format(studies="sftp://host/archive", more=[]),
            "sshfs",
            "sftp://host/archive: sftp needs sshfs: pip install 'impid[batch]'",
        ),
        (
            BATCH.format(studies=".", more=["--scheduler", "tcp://127.0.0.1:1"]),
            "distributed",
            "--scheduler needs distributed: pip install 'impid[batch]'",
        ),
        *(
            (
                f"from pathlib import Path\nfrom impid_host.study.{kind}_log import read_{kind}\n"
                f"try: read_{kind}(Path('a.{kind}'))\nexcept Exception as e: raise SystemExit(str(e))",
                library,
                f"a.{kind} ({kind.upper()}) needs {library}: pip install 'impid[{kind}]'",
            )
            for kind, library in (("xdf", "pyxdf"), ("mdf", "asammdf"), ("c3d", "ezc3d"))
        ),
    ],
)
def test_an_extra_that_is_missing_is_named(code: str, missing: str, words: str) -> None:
    done = python(code, (missing,))
    assert done.returncode == 1
    assert words in done.stderr
    assert "Traceback" not in done.stderr


def test_extras_are_declared_and_versions_come_from_one_place() -> None:
    from impid_host.extras import EXTRAS  # noqa: PLC0415

    declared = PROJECT["optional-dependencies"]
    assert set(EXTRAS.values()) <= set(declared)
    base = " ".join(PROJECT["dependencies"])
    for heavy in ("cffi", "unicorn", "pyelftools", "h5py", "aiohttp", "pandas", "mujoco"):
        assert heavy not in base
    asked = declared["all"][0]
    assert set(re.search(r"\[(.*)\]", asked)[1].split(",")) == set(declared) - {"all", "dev", "bench", "docs"}  # type: ignore[index]
    pattern = re.compile(rf"(?<![\d.]){re.escape(PROJECT['version'])}(?![\d.])")
    for place in ("host/impid_host/__init__.py", "hil_sim/__init__.py", "setup.py", "CITATION.cff"):
        assert not pattern.search((ROOT / place).read_text(encoding="utf-8")), place
