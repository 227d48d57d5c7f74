"""A file that only grows, but for its tail: what is kept, and behind it a piece that the next write
replaces."""

import contextlib
import os
import threading
from pathlib import Path
from typing import Self

from impid_host.errors import InputError


class Appender:
    """The file under a recording: collects, and writes on `flush` in one piece.

    Nothing reaches the disk in between, so an interrupted program leaves whole records. The tail is the
    record that still grows: each flush writes it anew in the same place, until it is collected and so
    kept. After a failed write (full disk) the file ends as the flush before left it."""

    def __init__(self, path: Path, descriptor: int) -> None:
        self.path = path
        self._descriptor = descriptor
        self._waiting = bytearray()
        self._written = 0
        self._tail = b""
        self._failure: InputError | None = None
        self._closing = False
        self._sync_wanted = threading.Event()
        self._syncer = threading.Thread(target=self._sync_on, name=f"sync {path.name}", daemon=True)
        self._syncer.start()

    @classmethod
    def create(cls, path: Path) -> Self:
        """Make a new file.

        Raises:
            InputError: it exists already, or it cannot be made here.
        """
        try:
            descriptor = os.open(
                path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o644
            )
        except FileExistsError:
            raise InputError(
                path,
                "exists already",
                "recordings are never overwritten: choose another name or move it away",
            ) from None
        except FileNotFoundError:
            raise InputError(
                path, "its folder does not exist", f"make it first: mkdir -p {path.parent}"
            ) from None
        except OSError as error:
            raise InputError(path, f"cannot be created ({error.strerror})", "choose another place") from None
        return cls(path, descriptor)

    def write(self, data: bytes) -> int:
        """Collect."""
        self._waiting += data
        return len(data)

    def tell(self) -> int:
        """Where the next byte that is kept will stand."""
        return self._written + len(self._waiting)

    def flush(self, tail: bytes = b"") -> None:
        """Hand what was collected, and the tail behind it, to the operating system: a killed program no
        longer loses it. The tail of the flush before is written over.

        After a failure nothing more is written.

        Raises:
            InputError: the disk is full or gone; the file then ends as the flush before left it.
        """
        if self._failure is not None:  # what follows a gap would not fit what stands before it
            raise self._failure
        kept = len(self._waiting)
        data = bytes(self._waiting) + tail
        self._waiting.clear()
        try:
            self._put(data)
            if len(data) < len(self._tail):
                os.ftruncate(self._descriptor, self._written + len(data))
        except OSError as error:
            with contextlib.suppress(OSError):
                self._put(self._tail)  # the room for it is there
            with contextlib.suppress(OSError):
                os.ftruncate(self._descriptor, self._written + len(self._tail))
            self._failure = InputError(
                self.path,
                f"cannot be written on ({error.strerror})",
                "what was recorded until then is kept in it; free some space before the next recording",
            )
            raise self._failure from None
        self._written += kept
        self._tail = tail

    def sync_soon(self) -> None:
        """Have a thread bring it to the disk, where a power cut no longer loses it."""
        self._sync_wanted.set()

    def close(self) -> None:
        """Bring it to the disk and close it; what was collected and not flushed is dropped."""
        self._closing = True
        self._sync_wanted.set()
        self._syncer.join()
        os.close(self._descriptor)

    def _put(self, data: bytes) -> None:
        os.lseek(self._descriptor, self._written, os.SEEK_SET)
        view, done = memoryview(data), 0
        while done < len(view):
            done += os.write(self._descriptor, view[done:])

    def _sync_on(self) -> None:
        while not self._closing:
            self._sync_wanted.wait()
            self._sync_wanted.clear()
            with contextlib.suppress(OSError):  # pipes and some network file systems cannot
                os.fsync(self._descriptor)
