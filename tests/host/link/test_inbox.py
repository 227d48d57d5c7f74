"""What waits in the port stays there until the recorder has dealt with what it has, but not for long."""

import itertools
import time

from impid_host.link.inbox import PILED_UP_BYTES, Inbox
from impid_host.link.link import Chunk


class Port:
    """Always full: counts the pieces that a thread takes from it."""

    def __init__(self, piece_bytes: int, interval_s: float = 0.0) -> None:
        self.taken = 0
        self._piece, self._interval_s = bytes(piece_bytes), interval_s

    def empty_into(self, inbox: Inbox) -> None:
        for number in itertools.count(1):
            if inbox.closing.is_set():
                return
            self.taken = number
            inbox.put(Chunk(number, 0, self._piece))
            time.sleep(self._interval_s)


def test_what_has_piled_up_is_not_taken_ahead_of_the_recorder() -> None:
    port = Port(PILED_UP_BYTES)
    inbox = Inbox("port", port.empty_into, "gone")
    ahead = []
    for done in range(30):
        chunk = inbox.take(1.0)
        assert chunk is not None
        assert chunk.monotonic_ns == done + 1
        time.sleep(0.001)  # decoding and writing it
        ahead.append(port.taken - done)
    inbox.stop()
    ahead.sort()
    assert ahead[len(ahead) * 3 // 4] == 1  # a scheduler may hold this thread up now and then
    assert ahead[-1] <= 10


def test_a_recorder_that_stands_still_does_not_stop_the_reading() -> None:
    port = Port(PILED_UP_BYTES)
    inbox = Inbox("port", port.empty_into, "gone")
    began = time.monotonic()
    inbox.take(1.0)
    while port.taken < 10:  # 10 KiB, 550 ms of the stream
        assert time.monotonic() - began < 5.0
        time.sleep(0.01)
    inbox.stop()


def test_small_pieces_are_never_waited_for() -> None:
    port = Port(PILED_UP_BYTES - 1, 0.0005)
    inbox = Inbox("port", port.empty_into, "gone")
    began = time.monotonic()
    while port.taken < 200:
        time.sleep(0.005)
    inbox.stop()
    assert time.monotonic() - began < 200 * 0.02 / 2
