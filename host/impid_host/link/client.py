"""The command protocol: every request has an id, is answered, and may be repeated without harm.

One thread owns a client. `pump` takes what the port has received, decodes it and hands it to the listener; a
request pumps until its answer is there, so nothing that arrives meanwhile is lost.
"""

import random
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, dataclass, fields
from typing import Protocol

from impid_host.clock.device import ClockExchange
from impid_host.errors import LinkError
from impid_host.link.board_info import BoardInfo
from impid_host.link.link import Chunk, Link
from impid_host.wire.decoder import LinkCounts
from impid_host.wire.messages import ITEM, OPCODE, PROTOCOL_VERSION, RESULT, RESULT_NAME, choices
from impid_host.wire.records import BoardStatus, Decoded, Response

TRIES = 4  # the request and three repeats
TIMEOUT_S = 0.4
# An answer stands in line behind the samples: as long as these come in, late, it is still to come.
BEHIND_S = 6.0
SELF_TEST_TIMEOUT_S = 5.0
RESTART_TIMEOUT_S = 10.0
_PINGS_REMEMBERED = 64
HOLD_SATURATED_US = 0xFFFF  # the board held the answer longer than it can say: t3 is unknown
# INFO has items 0 to 31, settings stand at 32 to 63, what outlives a reset from 64 on.
SETTINGS = tuple(name for name, number in ITEM.items() if 32 <= number < 64)
_SIGNED = frozenset(("ACCEL_X_ANGLE", "ACCEL_Y_ANGLE"))
_WORD = 1 << 32
FAULT_RECORD = tuple(name for name, number in ITEM.items() if number >= 64 and name.startswith("FAULT_"))
_SELF_TEST_RUNNING = choices("STATUS_HEALTH", "self_test")["RUNNING"]


class Listener(Protocol):
    """Who wants to see everything that passes, in order."""

    def received(self, chunk: Chunk, decoded: Decoded) -> None:
        """A chunk came in, and this is what it completed."""

    def sent(self, chunk: Chunk) -> None:
        """A chunk went out."""

    def exchanged(self, exchange: ClockExchange, boot_id: int) -> None:
        """A ping was answered."""


class _Nobody:
    def received(self, chunk: Chunk, decoded: Decoded) -> None: ...
    def sent(self, chunk: Chunk) -> None: ...
    def exchanged(self, exchange: ClockExchange, boot_id: int) -> None: ...


@dataclass(frozen=True, slots=True)
class Identity:
    """Which board, and which boot of it."""

    uid: tuple[int, int, int]
    boot_id: int
    reset_cause: int


@dataclass(frozen=True, slots=True)
class LastStream:
    """The boot before the one that tells, and the samples that it made since its last START."""

    boot_id: int
    produced: int


class BoardClient:
    """Talks to one board over one link."""

    def __init__(self, link: Link, listener: Listener | None = None) -> None:
        self.listener: Listener = listener or _Nobody()
        self._link = link
        self._decoder = link.carrier.decoder()
        # At random, because the board repeats its answer to an id that it has just seen, whoever used it.
        self._request_id = random.randrange(1 << 16)
        self._answers: deque[Response] = deque(maxlen=_PINGS_REMEMBERED)
        self._pings: dict[int, int] = {}
        self._latest_status: BoardStatus | None = None

    @property
    def counts(self) -> LinkCounts:
        """What came over the link so far, and what was lost."""
        return self._decoder.counts

    def reconnect(self, open_link: Callable[[], Link]) -> None:
        """Go on over another link of the same carrier; what was decoded and counted before stays.

        Raises:
            LinkError: it cannot be opened.
        """
        self._link.close()
        self._link = open_link()
        self._pings.clear()

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    @property
    def name(self) -> str:
        """The link's name."""
        return self._link.name

    def mute(self) -> None:
        """Tell nobody any more what passes."""
        self.listener = _Nobody()

    def pump(self, timeout_s: float) -> bool:
        """Take one chunk if one comes in time; True if it did.

        Raises:
            LinkError: the port is gone.
        """
        chunk = self._link.receive(timeout_s)
        if chunk is None:
            return False
        decoded = self._decoder.feed(chunk.data)
        self._answers.extend(decoded.responses)
        if decoded.statuses:
            self._latest_status = decoded.statuses[-1]
        self.listener.received(chunk, decoded)
        for pong in decoded.pongs:
            t1_ns = self._pings.pop(pong.request_id, None)
            if t1_ns is not None and pong.t3_us - pong.t2_us < HOLD_SATURATED_US:
                exchange = ClockExchange(t1_ns, pong.t2_us, pong.t3_us, chunk.monotonic_ns)
                self.listener.exchanged(exchange, pong.boot_id)
        return True

    def request(self, opcode: str, item: int = 0, value: int = 0, tries: int = TRIES) -> Response:
        """Ask and wait for the answer, repeats included.

        Raises:
            LinkError: no answer, a refusal, or the port is gone.
        """
        answer = self.answer(opcode, item, value, tries)
        if answer.result != RESULT["OK"]:
            reason = RESULT_NAME.get(answer.result, str(answer.result))
            raise LinkError(f"{self._link.name}: the board refuses {opcode} ({reason})")
        return answer

    def answer(self, opcode: str, item: int = 0, value: int = 0, tries: int = TRIES) -> Response:
        """The answer, whatever it says.

        Raises:
            LinkError: none came, or the port is gone.
        """
        answer = self._ask(opcode, item, value, tries)
        if answer is None:
            raise LinkError(self._silent(opcode))
        return answer

    def _silent(self, opcode: str) -> str:
        return (
            f"{self._link.name}: no answer to {opcode} after {TRIES} tries; "
            "check that this is the board's port, its speed, and that the board runs impid firmware"
        )

    def request_together(self, opcode: str, asked: Sequence[tuple[int, int]]) -> list[Response]:
        """The answers, whatever they say, to a few requests (item, value) sent at once.

        Raises:
            LinkError: one has no answer.
        """
        ids = [self._next_id() for _ in asked]
        carrier = self._link.carrier
        answers: dict[int, Response] = {}
        for _ in range(TRIES):
            missing = [n for n in range(len(asked)) if n not in answers]
            frames = [carrier.encode_command(ids[n], OPCODE[opcode], *asked[n]) for n in missing]
            self._send(carrier.preamble + b"".join(frames))
            for n in missing:
                answer = self._await_answer(ids[n])
                if answer is None:  # those behind it are asked for again with it
                    break
                answers[n] = answer
            if len(answers) == len(asked):
                return [answers[n] for n in range(len(asked))]
        raise LinkError(self._silent(opcode))

    def _answers_to(self, opcode: str, items: tuple[str, ...]) -> list[Response]:
        """The answers to a few questions asked at once: a board that has been reset streams again soon."""
        return self.request_together(opcode, [(ITEM[item], 0) for item in items])

    def _ask(self, opcode: str, item: int, value: int, tries: int) -> Response | None:
        request_id = self._next_id()
        carrier = self._link.carrier
        frame = carrier.encode_command(request_id, OPCODE[opcode], item, value)
        for attempt in range(tries):
            self._send(frame if attempt else carrier.preamble + frame)
            answer = self._await_answer(request_id)
            if answer is not None:
                return answer
        return self._await_behind_frames(request_id) if tries > 1 else None

    def ping(self) -> None:
        """Send a ping; the listener hears of the exchange when the answer comes."""
        request_id = self._next_id()
        chunk = self._send(self._link.carrier.encode_command(request_id, OPCODE["PING"], 0, 0))
        self._pings[request_id] = chunk.monotonic_ns
        while len(self._pings) > _PINGS_REMEMBERED:  # unanswered ones
            del self._pings[next(iter(self._pings))]

    def info(self) -> BoardInfo:
        """Ask for every item.

        Raises:
            LinkError: no answer, or a protocol that this version does not speak.
        """
        version = self.request("INFO", ITEM["PROTOCOL_VERSION"]).value
        if version != PROTOCOL_VERSION:
            raise LinkError(
                f"{self._link.name}: the board speaks protocol {version}, this program {PROTOCOL_VERSION}; "
                "update the older of the two"
            )
        always = [field.name for field in fields(BoardInfo) if field.default is MISSING]
        later = [field.name for field in fields(BoardInfo) if field.default is not MISSING]
        told = {name: self.request("INFO", ITEM[name.upper()]).value for name in always}
        answers = {name: self.answer("INFO", ITEM[name.upper()], 0) for name in later}
        known = {name: answer.value for name, answer in answers.items() if answer.result == RESULT["OK"]}
        return BoardInfo(**told, **known)

    def settings(self) -> dict[str, int]:
        """What the board keeps without power, by name; empty where its firmware knows no settings.

        Raises:
            LinkError: no answer.
        """
        found = self._read_all("GET", SETTINGS)
        for name in _SIGNED & {known.upper() for known in found}:
            found[name.lower()] = (found[name.lower()] + _WORD // 2) % _WORD - _WORD // 2
        return found

    def fault_record(self) -> dict[str, int]:
        """What the board remembers of its last fault, by name; empty where its firmware keeps none.

        Raises:
            LinkError: no answer.
        """
        return self._read_all("LOG", FAULT_RECORD)

    def last_stream(self) -> LastStream | None:
        """What the boot before this one had sampled; None after a loss of power, or where no board tells.

        Raises:
            LinkError: no answer.
        """
        boot_id, produced = self._answers_to("LOG", ("LAST_BOOT_ID", "LAST_PRODUCED"))
        if {boot_id.result, produced.result} != {RESULT["OK"]} or not boot_id.value:
            return None
        return LastStream(boot_id.value, produced.value)

    def _read_all(self, opcode: str, names: tuple[str, ...]) -> dict[str, int]:
        found = {}
        for name in names:
            answer = self.answer(opcode, ITEM[name], 0)
            if answer.result == RESULT["UNKNOWN_OPCODE"]:
                break
            if answer.result == RESULT["OK"]:
                found[name.lower()] = answer.value
        return found

    def store(self, settings: Mapping[str, int]) -> None:
        """Set several settings and save them; all are read back before they are saved.

        Raises:
            LinkError: no answer, or the board refuses one of them; nothing is saved then.
        """
        for name, value in settings.items():
            self.request("SET", ITEM[name], value % _WORD)
        for name, value in settings.items():
            kept = self.request("GET", ITEM[name]).value
            if kept != value % _WORD:
                raise LinkError(f"{self._link.name}: the board was told {name} = {value} but says {kept}")
        self.request("SAVE")

    def restart(self) -> tuple[int, int]:
        """Reset the board and wait until it answers; the boot ids before and after.

        Raises:
            LinkError: it refuses, or does not come back.
        """
        before = self.request("INFO", ITEM["BOOT_ID"]).value
        # Once only: a board that has restarted would take a repeat for a new request.
        answer = self._ask("RESET", 0, 0, tries=1)
        if answer is not None and answer.result != RESULT["OK"]:
            raise LinkError(f"{self._link.name}: the board refuses RESET ({RESULT_NAME.get(answer.result)})")
        deadline = time.monotonic() + RESTART_TIMEOUT_S
        while time.monotonic() < deadline:
            with suppress(LinkError):
                after = self.request("INFO", ITEM["BOOT_ID"]).value
                if after != before:
                    return before, after
            self.pump(TIMEOUT_S / 4)
        raise LinkError(f"{self._link.name}: the board does not come back after the reset; check its power")

    def identity(self) -> Identity:
        """Which board answers, and since which boot.

        Raises:
            LinkError: no answer.
        """
        x, y, z, boot_id, cause = (
            answer.value
            for answer in self._answers_to("INFO", ("UID_0", "UID_1", "UID_2", "BOOT_ID", "RESET_CAUSE"))
        )
        return Identity((x, y, z), boot_id, cause)

    def streaming(self) -> bool:
        """Whether the board says that it streams.

        Raises:
            LinkError: no answer.
        """
        return self.status().state == choices("STATUS_HEALTH", "state")["STREAMING"]

    def start(self) -> Response:
        """Start streaming; the answer's value is the index of the first sample."""
        return self.request("START")

    def stop(self) -> Response:
        """Stop streaming, harmless when nothing streams; the answer's value is the samples produced."""
        return self.request("STOP")

    def status(self) -> BoardStatus:
        """A status that arrived after it was asked for.

        Raises:
            LinkError: none came.
        """
        self._latest_status = None
        self.request("STATUS")
        deadline = time.monotonic() + TIMEOUT_S
        while time.monotonic() < deadline:
            if self._latest_status is not None:
                return self._latest_status
            self.pump(deadline - time.monotonic())
        raise LinkError(f"{self._link.name}: the board acknowledged STATUS but sent none; repeat the command")

    def self_test(self) -> int:
        """Run the accelerometer's self-test; the number that STATUS_HEALTH.self_test shows afterwards.

        Raises:
            LinkError: refused (the board is streaming), or it does not end.
        """
        self.request("SELF_TEST")
        deadline = time.monotonic() + SELF_TEST_TIMEOUT_S
        while time.monotonic() < deadline:
            outcome = self.status().self_test
            if outcome != _SELF_TEST_RUNNING:
                return outcome
            self.pump(TIMEOUT_S / 4)
        raise LinkError(f"{self._link.name}: the self-test does not end; reset the board")

    def tell(self, opcode: str, item: int = 0, value: int = 0) -> None:
        """Send a command once, of which no answer is expected: it resets the board."""
        self._send(self._link.carrier.encode_command(self._next_id(), OPCODE[opcode], item, value))

    def _next_id(self) -> int:
        self._request_id = (self._request_id + 1) % (1 << 16)
        return self._request_id

    def _send(self, frame: bytes) -> Chunk:
        chunk = self._link.send(frame)
        self.listener.sent(chunk)
        return chunk

    def _await_behind_frames(self, request_id: int) -> Response | None:
        """The answer to a request that was repeated often enough, for as long as the board is heard."""
        latest = time.monotonic() + BEHIND_S
        while time.monotonic() < latest:
            heard = self.counts.good_frames
            answer = self._await_answer(request_id)
            if answer is not None or self.counts.good_frames == heard:
                return answer
        return None

    def _await_answer(self, request_id: int) -> Response | None:
        deadline = time.monotonic() + TIMEOUT_S
        while True:
            for answer in self._answers:
                if answer.request_id == request_id:
                    return answer
            left = deadline - time.monotonic()
            if left <= 0:
                return None
            self.pump(left)
