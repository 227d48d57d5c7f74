"""Packages that only some need: imported when they are; a line names the extra where they lack."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from impid_host.errors import ImpidError

# package -> the extra of pyproject.toml that brings it
EXTRAS = {
    "aiohttp": "view",
    "can": "can",
    "distributed": "batch",
    "fsspec": "batch",
    "h5py": "mat",
    "pandas": "pandas",
    "pinocchio": "urdf",
    "pint": "import",
    "rosbags": "ros",
    "s3fs": "batch",
    "sshfs": "batch",
    "simpleeval": "import",
    "xarray": "xarray",
}


class MissingExtraError(ImpidError, ImportError):
    """A package that is not installed; names the extra that brings it."""


def installed(package: str) -> bool:
    """Whether a package could be imported."""
    try:
        return find_spec(package) is not None
    except ModuleNotFoundError:
        return False


def need(package: str, what: str) -> None:
    """See to it that a package is installed, without importing it.

    Args:
        what: needs it, "a MATLAB 7.3 file" say.

    Raises:
        MissingExtraError: it is not.
    """
    if not installed(package):
        raise MissingExtraError(f"{what} needs {package}: pip install 'impid[{EXTRAS[package]}]'")


def extra(package: str, what: str) -> Any:
    """The package, imported; errors as `need`."""
    need(package, what)
    return import_module(package)
