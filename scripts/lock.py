"""Write requirements.lock: the versions here of everything that `pip install '.[dev]'` brings, at any remove.

Run by `make lock` after an upgrade, or alone after an extra was added. Constraints, no demands: what a system
does not need stays out. The versions are those of Python 3.11 on Linux.
"""

import sys
import tomllib
from collections import deque
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parent.parent
LOCK = ROOT / "requirements.lock"
HEAD = "# Made by scripts/lock.py: the versions that CI tests with, Python 3.11 on Linux.\n"


def main() -> None:
    pinned, missing = closure()
    if missing:
        sys.exit(f"not installed here: {', '.join(sorted(missing))}; pip install '.[dev]' first")
    lines = (f"{name}=={number}\n" for name, number in sorted(pinned.items()))
    LOCK.write_text(HEAD + "".join(lines), encoding="utf-8")


def closure() -> tuple[dict[str, str], set[str]]:
    """Versions by name, and what is wanted but not installed."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    waiting = deque(Requirement(one) for one in (*project["dependencies"], *extras["dev"], *build))
    pinned: dict[str, str] = {}
    missing: set[str] = set()
    seen: set[tuple[str, str]] = set()
    while waiting:
        one = waiting.popleft()
        name = canonicalize_name(one.name)
        for extra in ("", *one.extras):
            if (name, extra) in seen:
                continue
            seen.add((name, extra))
            if name == "impid":
                waiting.extend(Requirement(own) for own in extras.get(extra, []))
                continue
            try:
                pinned[name] = version(name)
            except PackageNotFoundError:
                missing.add(name)
                continue
            for own in map(Requirement, requires(name) or ()):
                if own.marker is None or own.marker.evaluate({"extra": extra}):
                    waiting.append(own)
    return pinned, missing


if __name__ == "__main__":
    main()
