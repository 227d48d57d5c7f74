"""A worker's hold on its child process: one study asked for, its answer, or why there is none."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from impid_host.batch.task import Answer, BatchOptions

# One thread for linear algebra: the workers share the cores, and the sums do not depend on their number.
_ALONE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
# The child imports this package, wherever the parent has it from.
_HOME = str(Path(__file__).resolve().parents[2])
_PATH = [part for part in os.environ.get("PYTHONPATH", "").split(os.pathsep) if part]
_own = threading.local()
_LAST_WORDS = 2000
_READY = b"ready\n"


class _DiedError(Exception):
    """The child ended without an answer."""


class Child:
    """The process; started at the first question, and again after it broke."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115  (closed with the child)
        self._late = False

    def answer(self, address: str, options: BatchOptions, known: frozenset[str], timeout_s: float) -> Answer:
        """Work on one study, unless its key is among the `known`."""
        first = Answer(address, "unreadable")
        try:
            self._running()
            ends = time.monotonic() + timeout_s
            first = self._ask({"study": address, "options": asdict(options)}, ends)
            if first.status != "fitted":
                return first
            if first.key in known:
                self._send({"go": False})
                return replace(first, status="done before")
            return self._ask({"go": True}, ends)
        except _DiedError as error:
            if self._late:
                why = f"took more than {timeout_s:g} s"
                return replace(first, status="timed out", why=why, remedy="give more time with --timeout")
            remedy = (
                f"`impid-host fit {address}` shows more; out of memory: fewer --jobs, or a larger machine"
            )
            return replace(first, status="crashed", why=str(error), remedy=remedy)

    def close(self) -> None:
        """End the process, whatever it is doing."""
        if self._process is None:
            return
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):  # what it did not take any more
                    pipe.close()
        self._process = None

    def _ask(self, request: dict[str, Any], ends: float) -> Answer:
        process = self._running()
        self._late = False
        timer = threading.Timer(max(0.0, ends - time.monotonic()), self._too_late, [process])
        timer.daemon = True
        timer.start()
        try:
            self._send(request)
            line = process.stdout.readline() if process.stdout is not None else b""
        except OSError:
            line = b""
        finally:
            timer.cancel()
        if not line.endswith(b"\n"):
            raise _DiedError(self._last_words(process))
        return Answer.from_json(line)

    def _send(self, request: dict[str, Any]) -> None:
        pipe = self._running().stdin
        if pipe is not None:
            pipe.write(json.dumps(request).encode() + b"\n")
            pipe.flush()

    def _too_late(self, process: subprocess.Popen[bytes]) -> None:
        self._late = True
        process.kill()

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "impid_host.batch.child"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                env={**os.environ, **_ALONE, "PYTHONPATH": os.pathsep.join([_HOME, *_PATH])},
                start_new_session=True,  # an interrupt of the terminal is the parent's to act upon
            )
            # What it takes to start, which is imports, is not the study's time.
            if self._process.stdout is None or self._process.stdout.readline() != _READY:
                raise _DiedError(self._last_words(self._process))
        return self._process

    def _last_words(self, process: subprocess.Popen[bytes]) -> str:
        """How it ended, and the last line that it wrote; another one is started at the next question."""
        try:
            code = process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            code = 0
        self.close()
        self._errors.seek(0, os.SEEK_END)
        self._errors.seek(max(0, self._errors.tell() - _LAST_WORDS))
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        self._errors.seek(0)
        self._errors.truncate()
        how = f"by {signal.Signals(-code).name}" if code < 0 else f"with status {code}"
        return f"the process ended {how}" + (f": {lines[-1]}" if lines else "")


def in_this_thread(address: str, options: BatchOptions, known: frozenset[str], timeout_s: float) -> Answer:
    """Work on one study in the child of this thread, which is started where there is none.

    What a cluster's worker runs; the child ends with the worker.
    """
    if not hasattr(_own, "child"):
        _own.child = Child()
    child: Child = _own.child
    return child.answer(address, options, known, timeout_s)
