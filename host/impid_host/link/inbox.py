"""The reading half of every link: a thread lays down what arrives, the recorder takes it in order.

After a stall of the machine much waits in the port, and the thread could take all of it into this
program's memory before the recorder has written any. A kill just then would lose it, while what still waits
in the port is lost to nobody. So behind a large piece the thread waits until the recorder is done with it,
but not for long: the system's buffer is small, and what the recorder does may take a second.
"""

import queue
import threading
import time
from collections.abc import Callable

from impid_host.errors import LinkError
from impid_host.link.link import Chunk

POLL_S = 0.1  # how long a read may wait before it looks whether the link is being closed
# A piece of this size has piled up: 55 ms of the serial stream, 21 ms of CAN.
PILED_UP_BYTES = 1024
# With 1 KiB of serial and 64 frames of CAN at a time the stream is still outrun.
_PATIENCE_S = 0.02


class Inbox:
    """Chunks in the order of their arrival.

    Args:
        name: of the link.
        fill: runs in the thread: puts chunks until the carrier or the inbox is closed.
        gone: what `take` says when the carrier is gone.
    """

    def __init__(self, name: str, fill: Callable[["Inbox"], None], gone: str) -> None:
        self.closing = threading.Event()
        self._gone = gone
        self._queue: queue.SimpleQueue[Chunk | None] = queue.SimpleQueue()
        self._put = self._taken = self._done = 0  # chunks
        self._progress = threading.Event()
        self._reader = threading.Thread(target=self._run, args=(fill,), name=f"read {name}", daemon=True)
        self._reader.start()

    def put(self, chunk: Chunk) -> None:
        """Lay one down; the reading thread alone does. Behind a large one it waits a little."""
        self._queue.put(chunk)
        self._put += 1
        if len(chunk.data) >= PILED_UP_BYTES:
            self._await_done(time.monotonic() + _PATIENCE_S)

    def take(self, timeout_s: float) -> Chunk | None:
        """The next chunk, or None when nothing came in time. Whoever asks is done with those before.

        Raises:
            LinkError: the carrier is gone and every chunk that came before has been taken.
        """
        self._done = self._taken
        self._progress.set()
        try:
            chunk = self._queue.get(timeout=timeout_s) if timeout_s > 0 else self._queue.get_nowait()
        except queue.Empty:
            return None
        if chunk is None:
            self._queue.put(None)
            raise LinkError(self._gone)
        self._taken += 1
        return chunk

    def stop(self) -> None:
        """Have the thread end; a read that hangs is not waited for long."""
        self.closing.set()
        self._reader.join(timeout=5 * POLL_S)

    def _await_done(self, deadline: float) -> None:
        while not self.closing.is_set():
            self._progress.clear()
            left_s = deadline - time.monotonic()
            if self._done >= self._put or left_s <= 0:
                break
            self._progress.wait(left_s)

    def _run(self, fill: Callable[["Inbox"], None]) -> None:
        fill(self)
        self._queue.put(None)
