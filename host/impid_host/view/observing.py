"""The view's own observer of the load's force: a process of its own, whose end is a sentence on the page."""

import asyncio
import contextlib
import json
import os
import sys
from collections.abc import AsyncIterator, Mapping
from typing import Any, Self

_BACKLOG_BYTES = 256 << 10
_LONGEST_LINE = 1 << 22


class Observing:
    """A running observer.

    Attributes:
        skipped: pieces of samples that it was too busy to take.
    """

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.skipped = 0
        self._process = process

    @classmethod
    async def start(cls, order: Mapping[str, Any]) -> Self:
        """Start it with its order (`live.order.Order`)."""
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "impid_host.live.process",
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            limit=_LONGEST_LINE,
            # Its matrices are small: threads of a library would only take cores away from the recorder.
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )
        own = cls(process)
        own.forward(json.dumps(order).encode() + b"\n")
        return own

    def forward(self, line: bytes) -> None:
        """Pass on a piece of samples; it is left out and counted where too much waits already."""
        pipe = self._process.stdin
        if pipe is None or pipe.is_closing() or pipe.transport.get_write_buffer_size() > _BACKLOG_BYTES:
            self.skipped += 1
            return
        with contextlib.suppress(ConnectionError):
            pipe.write(line)

    async def messages(self) -> AsyncIterator[dict[str, Any]]:
        """What it says, until it ends, and then that it has."""
        last = ""
        if self._process.stdout is not None:
            async for line in self._process.stdout:
                with contextlib.suppress(ValueError):
                    message = json.loads(line)
                    last = message.get("words", last)
                    yield message
        code = await self._process.wait()
        words = f"the force is observed no longer (exit code {code}); the recording goes on"
        yield {"kind": "observer", "words": f"{last}; {words}" if code == 0 and last else words}

    def close(self) -> None:
        """End it: it goes when nothing can come any more."""
        if self._process.stdin is not None:
            self._process.stdin.close()
