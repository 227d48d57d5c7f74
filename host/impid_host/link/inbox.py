"""The reading half of every link: a thread lays down what arrives, the recorder takes it in order."""

import queue
import threading
from collections.abc import Callable

from impid_host.errors import LinkError
from impid_host.link.link import Chunk

POLL_S = 0.1  # how long a read may wait before it looks whether the link is being closed


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
        self._reader = threading.Thread(target=self._run, args=(fill,), name=f"read {name}", daemon=True)
        self._reader.start()

    def put(self, chunk: Chunk) -> None:
        """Lay one down; the reading thread alone does."""
        self._queue.put(chunk)

    def take(self, timeout_s: float) -> Chunk | None:
        """The next chunk, or None when nothing came in time.

        Raises:
            LinkError: the carrier is gone and every chunk that came before has been taken.
        """
        try:
            chunk = self._queue.get(timeout=timeout_s) if timeout_s > 0 else self._queue.get_nowait()
        except queue.Empty:
            return None
        if chunk is None:
            self._queue.put(None)
            raise LinkError(self._gone)
        return chunk

    def stop(self) -> None:
        """Have the thread end; a read that hangs is not waited for long."""
        self.closing.set()
        self._reader.join(timeout=5 * POLL_S)

    def _run(self, fill: Callable[["Inbox"], None]) -> None:
        fill(self)
        self._queue.put(None)
