"""The recorder's end of the live view.

What was decoded goes down a pipe to the serving process. The pipe never blocks: when the other end is busy,
pieces are left out and counted, and the recording goes on undisturbed.
"""

import json
import os
import queue
import secrets
import subprocess
import sys
import threading
from typing import Any, Self

import numpy as np

from impid_host.errors import LinkError
from impid_host.recording.recorder import Progress
from impid_host.view.scale import Scale
from impid_host.wire.records import Decoded

_READY_S = 35.0
_STOP_S = 3.0
_BACKLOG_BYTES = 256 << 10


class LiveView:
    """A running view; an `Onlooker` of the recorder. Close it when done.

    Attributes:
        url: where the page is.
        token: whoever wants to stop or mark from the page has to know it.
        skipped: pieces that the view was too busy to take.
    """

    def __init__(self, process: subprocess.Popen[bytes], token: str, shown: dict[str, Any]) -> None:
        assert process.stdin is not None
        self.token = token
        self.skipped = 0
        self.stop_requested = False
        self._process = process
        self._pipe = process.stdin
        self._waiting = bytearray()
        self._marks: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._ready: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self._pipe.write(json.dumps({"token": token, **shown}).encode() + b"\n")
        self._pipe.flush()
        os.set_blocking(self._pipe.fileno(), False)
        threading.Thread(target=self._listen, name="live view", daemon=True).start()
        self.url = self._await_url()

    @classmethod
    def start(
        cls,
        scale: Scale,
        rate_hz: float,
        host: str = "127.0.0.1",
        port: int = 0,
        observer: dict[str, Any] | None = None,
    ) -> Self:
        """Serve on host:port (0: any that is free).

        Args:
            scale: of the board, to physical units; rate_hz: of its samples.
            observer: order of an observer of the load's force (`live.order.Order`); None: no force is shown.

        Raises:
            LinkError: it cannot serve there.
        """
        command = [sys.executable, "-m", "impid_host.view.server", host, str(port)]
        # Ctrl-C is for the recorder, which then closes the view.
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        shown = {"scale": scale.to_dict(), "rate_hz": rate_hz, "observer": observer}
        return cls(process, secrets.token_urlsafe(12), shown)

    def see(self, decoded: Decoded) -> None:
        """Pass on the samples of a chunk."""
        for segment in decoded.segments:
            s = segment.samples
            self._pass_on(
                {
                    "kind": "samples",
                    "boot_id": segment.boot_id,
                    "run": segment.run,
                    "index": segment.index.tolist(),
                    "t_us": s.t_us.tolist(),
                    "ax": s.ax.tolist(),
                    "ay": s.ay.tolist(),
                    "enc1": s.enc1.tolist(),
                    "enc2": s.enc2.tolist(),
                    "flags": int(np.bitwise_or.reduce(s.flags)),
                }
            )

    def progress(self, progress: Progress) -> None:
        """Pass on how the recording stands."""
        clock = progress.clock
        self._pass_on(
            {
                "kind": "progress",
                "elapsed_s": round(progress.elapsed_s, 3),
                "connected": progress.connected,
                "stored": progress.counts.stored,
                "lost": progress.counts.lost,
                "damaged": progress.counts.bad_frames,
                "clock": None if clock is None else str(clock),
                "skipped": self.skipped,
            }
        )

    def take_marks(self) -> list[str]:
        """Marks that were set on the page since the last call."""
        marks = []
        while not self._marks.empty():
            marks.append(self._marks.get())
        return marks

    def close(self) -> None:
        """End the serving process."""
        self._process.terminate()
        try:
            self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _pass_on(self, message: dict[str, Any]) -> None:
        if len(self._waiting) > _BACKLOG_BYTES:
            self.skipped += 1
        else:
            self._waiting += json.dumps(message, separators=(",", ":")).encode() + b"\n"
        try:
            del self._waiting[: os.write(self._pipe.fileno(), self._waiting)]
        except BlockingIOError:
            pass
        except OSError:  # the view has gone; the recording goes on
            self._waiting.clear()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            told = json.loads(line)
            if "url" in told or "error" in told:
                self._ready.put(told)
            elif told.get("command") == "stop":
                self.stop_requested = True
            elif told.get("command") == "mark":
                self._marks.put(str(told.get("text", "")))
        self._ready.put(None)

    def _await_url(self) -> str:
        try:
            told = self._ready.get(timeout=_READY_S)
        except queue.Empty:
            told = None
        if told is None or "error" in told:
            self.close()
            why = "it did not start" if told is None else str(told["error"])
            raise LinkError(f"the live view cannot be served: {why}; choose another --view-address")
        return str(told["url"])
