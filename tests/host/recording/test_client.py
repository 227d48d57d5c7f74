"""The command protocol against the firmware core, over a pseudo-terminal."""

import time

import pytest
from cobs import cobs
from impid_host.clock.device import ClockExchange, fit_clock
from impid_host.errors import LinkError
from impid_host.link.client import TIMEOUT_S, TRIES, BoardClient
from impid_host.link.link import Chunk
from impid_host.link.port import SerialLink
from impid_host.wire.messages import ITEM, KIND, choices
from impid_host.wire.records import Decoded


class Notes:
    """Remembers what a client tells its listener."""

    def __init__(self) -> None:
        self.samples = 0
        self.exchanges: list[ClockExchange] = []

    def received(self, chunk: Chunk, decoded: Decoded) -> None:
        self.samples += sum(len(segment) for segment in decoded.segments)

    def sent(self, chunk: Chunk) -> None: ...

    def exchanged(self, exchange: ClockExchange, boot_id: int) -> None:
        assert boot_id == 77
        self.exchanges.append(exchange)


def test_info(board) -> None:
    with SerialLink.open(board.port) as link:
        info = BoardClient(link).info()
    assert (info.boot_id, info.sample_rate_hz, info.group_delay_us) == (77, 1000, 2006)
    assert (info.full_scale_code, info.uid_0) == (65536, 0x00320044)


def test_start_stop_and_status(board) -> None:
    with SerialLink.open(board.port) as link:
        notes = Notes()
        client = BoardClient(link, notes)
        client.start()
        while notes.samples < 100:
            client.pump(0.1)
        client.stop()
        status = client.status()
        assert status.state == choices("STATUS_HEALTH", "state")["IDLE"]
        assert status.produced == notes.samples


def test_lost_requests_and_answers_are_repeated_without_repeating_the_action(board) -> None:
    """Three answers to START vanish; it is carried out once, and a fourth that vanished would be too many."""
    vanish, rest = [0], [b""]

    def drop(data: bytes) -> bytes:
        kept = b""
        *frames, rest[0] = (rest[0] + data).split(b"\0")
        for frame in frames:
            answer = bool(frame) and cobs.decode(frame)[0] == KIND["RESPONSE"]
            if answer and vanish[0]:
                vanish[0] -= 1
            else:
                kept += frame + b"\0"
        return kept

    with SerialLink.open(board.port) as link:
        client = BoardClient(link)
        before = client.status().accepted
        vanish[0], board.mangle = 3, drop
        assert client.start().value == 0
        assert vanish[0] == 0
        client.stop()
        # START, STOP and the STATUS that asks: a repeated request is answered again, not carried out again.
        assert client.status().accepted == before + 3
        vanish[0] = 4
        with pytest.raises(LinkError, match="no answer to STOP after 4 tries"):
            client.stop()


def test_an_answer_that_stands_in_line_behind_samples_is_waited_for(board) -> None:
    """A busy machine takes samples in late, and the answer after them: all tries were sent long before it."""
    kept, rest, free_at = [b""], [b""], [float("inf")]

    def hold_answers(data: bytes) -> bytes:
        passed = b""
        *frames, rest[0] = (rest[0] + data).split(b"\0")
        for frame in frames:
            if frame and cobs.decode(frame)[0] == KIND["RESPONSE"]:
                kept[0] += frame + b"\0"
            else:
                passed += frame + b"\0"
        if time.monotonic() >= free_at[0]:
            passed, kept[0] = passed + kept[0], b""
        return passed

    with SerialLink.open(board.port) as link:
        client = BoardClient(link)
        client.start()
        began = time.monotonic()
        free_at[0], board.mangle = began + 1.5 * TRIES * TIMEOUT_S, hold_answers
        assert client.request("INFO", ITEM["BOOT_ID"]).value == 77
        assert time.monotonic() >= free_at[0]
        board.mangle = lambda data: data
        client.stop()


def test_refusals_are_named(board) -> None:
    with SerialLink.open(board.port) as link:
        client = BoardClient(link)
        with pytest.raises(LinkError, match=r"refuses INFO \(BAD_ITEM\)"):
            client.request("INFO", 250)
        client.start()
        with pytest.raises(LinkError, match=r"refuses SELF_TEST \(BUSY\)"):
            client.self_test()
        client.stop()


def test_self_test_ends_with_a_verdict(board) -> None:
    """The readings do not move when the self-test pin is driven, so both axes fail."""
    with SerialLink.open(board.port) as link:
        outcome = BoardClient(link).self_test()
    assert outcome == choices("STATUS_HEALTH", "self_test")["FAILED_BOTH"]


def test_pings_measure_the_clock(board) -> None:
    with SerialLink.open(board.port) as link:
        notes = Notes()
        client = BoardClient(link, notes)
        while len(notes.exchanges) < 20:
            client.ping()
            client.pump(0.05)
    fit = fit_clock(notes.exchanges)
    assert 0 < fit.hard_bound_us < 20_000
    for each in notes.exchanges:
        assert each.t1_ns < each.t4_ns
        assert each.t2_us <= each.t3_us
