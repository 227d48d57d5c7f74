"""Folders by path or by address: on this disk, in an object store (`s3://`), on another machine (`sftp://`).

What is on this disk needs nothing; the rest goes through fsspec, whose configuration holds credentials and
endpoints (docs/batch.md).
"""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path, PurePosixPath
from typing import Any, Protocol

from impid_host.errors import InputError
from impid_host.extras import need

# What a study is read from; pictures and recordings beside it are not fetched.
_OF_A_STUDY = (".toml", ".csv", ".urdf", ".json")
_SETUP = "setup.toml"


class Place(Protocol):
    """A folder, here or elsewhere. Every method raises InputError where it cannot be reached."""

    address: str

    def studies(self) -> list[str]:
        """Addresses of the study folders at or below it, sorted; those within a study are not looked for."""

    def names(self) -> list[str]:
        """Names of the files in it; none where it does not exist."""

    def read(self, name: str) -> bytes:
        """A file's bytes."""

    def write(self, name: str, data: bytes) -> None:
        """Make or replace a file, whole or not at all."""

    def remove(self, name: str) -> None:
        """Remove a file that may be gone already."""

    def fetch(self, folder: Path) -> Path:
        """The study in it as a folder on this disk, copied below `folder` where it is elsewhere."""


def place(address: str | Path) -> Place:
    """The folder at a path or an address.

    Raises:
        MissingExtraError: the address needs a package that is not installed; names the extra that brings it.
    """
    text = str(address)
    return _Elsewhere(text) if is_address(text) else _Here(text)


def is_address(text: str) -> bool:
    """Whether it names a folder elsewhere, `s3://bucket/folder` say."""
    return "://" in text and not text.startswith("file://")


@contextmanager
def study_folder(address: str) -> Iterator[Path]:
    """A study as a folder on this disk, for as long as it is worked on."""
    with tempfile.TemporaryDirectory(prefix="impid-study-") as folder:
        yield place(address).fetch(Path(folder))


class _Here:
    """A folder on this disk."""

    def __init__(self, address: str) -> None:
        self._folder = Path(address.removeprefix("file://")).absolute()
        self.address = str(self._folder)

    def studies(self) -> list[str]:
        if not self._folder.is_dir():
            what = "is not a folder" if self._folder.exists() else "does not exist"
            raise InputError(self._folder, what, "give study folders, or folders that hold them")
        found = []
        for folder, below, files in os.walk(self._folder):
            if _SETUP in files:
                found.append(folder)
                below.clear()
            below[:] = sorted(name for name in below if not name.startswith("."))
        if not found:
            raise InputError(self._folder, "holds no study", f"give folders that hold {_SETUP}")
        return sorted(found)

    def names(self) -> list[str]:
        if not self._folder.is_dir():
            return []
        return sorted(entry.name for entry in os.scandir(self._folder) if entry.is_file())

    def read(self, name: str) -> bytes:
        with _told(self._folder / name):
            return (self._folder / name).read_bytes()

    def write(self, name: str, data: bytes) -> None:
        draft = self._folder / f".{name}.part"
        with _told(self._folder):
            self._folder.mkdir(parents=True, exist_ok=True)
            draft.write_bytes(data)
            draft.replace(self._folder / name)

    def remove(self, name: str) -> None:
        with _told(self._folder):
            (self._folder / name).unlink(missing_ok=True)

    def fetch(self, folder: Path) -> Path:  # noqa: ARG002
        return self._folder


class _Elsewhere:
    """A folder that fsspec reaches."""

    def __init__(self, address: str) -> None:
        self.address = address.rstrip("/")
        need("fsspec", f"{address}: an address")
        scheme = address.partition("://")[0]
        if scheme in _DRIVERS:
            need(_DRIVERS[scheme], f"{address}: {scheme}")
        with _reached(address):
            self._files: Any
            core, config = (import_module(f"fsspec.{name}") for name in ("core", "config"))
            # sshfs believes any host unless it is told to look into known_hosts, and is not told of `conf`.
            ssh = {"known_hosts": (), **config.conf.get("ssh", {})} if scheme in ("sftp", "ssh") else {}
            self._files, self._path = core.url_to_fs(self.address, **ssh)

    def studies(self) -> list[str]:
        with _reached(self.address):
            found = [path for path in self._files.find(self._path) if path.rpartition("/")[2] == _SETUP]
        folders = sorted(path.rpartition("/")[0] for path in found)
        outer: list[str] = []
        for folder in folders:
            if not outer or not folder.startswith(outer[-1] + "/"):
                outer.append(folder)
        if not outer:
            raise InputError(self.address, "holds no study", f"give folders that hold {_SETUP}")
        return [self.address + folder[len(self._path) :] for folder in outer]

    def names(self) -> list[str]:
        with _reached(self.address):
            self._files.invalidate_cache()
            try:
                entries = self._files.ls(self._path, detail=True)
            except FileNotFoundError:
                return []
            return sorted(PurePosixPath(own["name"]).name for own in entries if own["type"] == "file")

    def read(self, name: str) -> bytes:
        with _reached(f"{self.address}/{name}"):
            return bytes(self._files.cat_file(f"{self._path}/{name}"))

    def write(self, name: str, data: bytes) -> None:
        target = f"{self._path}/{name}"
        with _reached(self.address):
            if self.address.startswith("s3://"):
                self._files.pipe_file(target, data)  # an object appears when it is whole
                return
            draft = f"{self._path}/.{name}.part"
            self._files.makedirs(self._path, exist_ok=True)
            with self._files.open(draft, "wb") as file:
                file.write(data)
            with contextlib.suppress(FileNotFoundError):
                self._files.rm_file(target)  # SFTP does not rename onto a file that is there
            self._files.mv(draft, target)

    def remove(self, name: str) -> None:
        with _reached(self.address), contextlib.suppress(FileNotFoundError):
            self._files.rm_file(f"{self._path}/{name}")

    def fetch(self, folder: Path) -> Path:
        target = folder / PurePosixPath(self._path).name
        with _reached(self.address):
            paths = [path for path in self._files.find(self._path) if path.endswith(_OF_A_STUDY)]
            for path in paths:
                local = target / path[len(self._path) :].lstrip("/")
                local.parent.mkdir(parents=True, exist_ok=True)
                with self._files.open(path, "rb") as source, local.open("wb") as sink:
                    shutil.copyfileobj(source, sink)
        if not paths:
            raise InputError(self.address, "holds no study", f"give a folder that holds {_SETUP}")
        return target


# scheme -> the package that speaks it
_DRIVERS = {"s3": "s3fs", "sftp": "sshfs", "ssh": "sshfs"}


@contextmanager
def _told(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(
            path, f"cannot be used ({error.strerror})", "check path, permissions and space"
        ) from None


@contextmanager
def _reached(address: str) -> Iterator[None]:
    """Libraries of every store have errors of their own; all of them mean that it was not reached."""
    try:
        yield
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(address, "does not exist", "check the address") from None
    except Exception as error:
        words = str(error).strip().splitlines()
        why = f"{type(error).__name__}: {words[0]}" if words else type(error).__name__
        remedy = "check the address, the network and the credentials (docs/batch.md)"
        raise InputError(address, f"cannot be reached ({why})", remedy) from None
