"""Hashes of a study's files: which data a number is of."""

import hashlib
import tomllib
from pathlib import Path


def file_hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of setup.toml, of the robot's URDF and of every trial's files, by path within the study."""
    places = [folder / "setup.toml", *sorted(folder.glob("*/trial.toml")), *sorted(folder.glob("*/*.csv"))]
    names = [place.relative_to(folder).as_posix() for place in places] + _named_urdf(folder / "setup.toml")
    return {
        name: hashlib.sha256((folder / name).read_bytes()).hexdigest()
        for name in names
        if (folder / name).is_file()
    }


def _named_urdf(setup: Path) -> list[str]:
    """The URDF as setup.toml names it; it may lie outside the study. None of a file that is no setup."""
    try:
        named = tomllib.loads(setup.read_text(encoding="utf-8")).get("robot", {}).get("urdf")
    except (OSError, ValueError, AttributeError):
        return []
    return [named] if isinstance(named, str) else []
