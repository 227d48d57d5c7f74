"""A CAN adapter that speaks Lawicel's ASCII commands on a serial line, as cheap USB adapters do.

Every command ends in CR and is answered: CR, or text and CR, or BELL for what the adapter refuses. Frames
from the bus come unasked, in the form in which they are sent: `t`, identifier in 3 hexadecimal digits, length
in one, data, CR. Source: Lawicel AB, CANUSB manual, command set.
"""

import time
from collections.abc import Callable

from hil_sim.carriers.protocol import CanFrame, Carrier

CR, BELL = b"\r", b"\a"
LONGEST = 64  # a command; longer rubbish is thrown away
BITRATES = (10, 20, 50, 100, 125, 250, 500, 800, 1000)  # kbit/s behind S0 to S8
BUS_KBPS = 1000
# Bits of the answer to F.
ERROR_WARNING, BUS_ERROR = 0x04, 0x80
STANDARD_LIMIT = 0x7FF
TIMESTAMP_MODULUS_MS = 60000


class SlcanCarrier:
    """Implements `CanCarrier`: the adapter between a bus of 1 Mbit/s and a serial line."""

    def __init__(self, line: Carrier) -> None:
        self._line = line
        self._commands: dict[str, Callable[[str], bytes]] = {
            "S": self._set_bitrate,
            "s": self._set_timing,
            "O": lambda rest: self._open(rest, listen_only=False),
            "L": lambda rest: self._open(rest, listen_only=True),
            "C": self._close_channel,
            "t": lambda rest: self._transmit(rest, digits=3, remote=False),
            "T": lambda rest: self._transmit(rest, digits=8, remote=False),
            "r": lambda rest: self._transmit(rest, digits=3, remote=True),
            "R": lambda rest: self._transmit(rest, digits=8, remote=True),
            "F": self._flags,
            "V": lambda rest: BELL if rest else b"V1013\r",
            "N": lambda rest: BELL if rest else b"NIMPD\r",
            "Z": self._set_timestamps,
            "M": lambda rest: self._filter(rest, "00000000"),
            "m": lambda rest: self._filter(rest, "FFFFFFFF"),
        }
        self._reset()

    def _reset(self) -> None:
        self._rest = b""
        self._kbps: int | None = None
        self._is_open = False
        self._listen_only = False
        self._timestamps = False
        self._error_flags = 0
        self._received: list[CanFrame] = []

    @property
    def address(self) -> str:
        """The adapter's serial port."""
        return self._line.address

    @property
    def config(self) -> dict[str, str | int]:
        """Keyword arguments with which `can.Bus` joins."""
        return {"interface": "slcan", "channel": self.address, "bitrate": 1000 * BUS_KBPS}

    @property
    def connected(self) -> bool:
        """A client has the port open."""
        return self._line.connected

    @property
    def dropped(self) -> int:
        """Bytes lost because the client did not read."""
        return self._line.dropped

    def pull(self) -> None:
        """The adapter is unplugged and forgets everything."""
        self._line.pull()
        self._reset()

    def plug(self) -> None:
        """The adapter is plugged in, its channel closed."""
        self._line.plug()

    def close(self) -> None:
        """Takes the adapter away."""
        self._line.close()

    def receive(self, timeout_s: float) -> list[CanFrame]:
        """Waits for commands, at most timeout_s; returns the frames that they put on the bus."""
        *lines, self._rest = (self._rest + self._line.receive(timeout_s)).split(CR)
        # Of what is too long no more is kept than shows that it was.
        self._rest = self._rest[: LONGEST + 1]
        answers = b"".join(self._answer(line) for line in lines)
        if answers:
            self._line.send(answers)
        frames, self._received = self._received, []
        return frames

    def send(self, frames: list[CanFrame]) -> None:
        """Hands frames of the bus to the client, if its channel is open and hears them."""
        if not self._is_open:
            return
        if self._kbps != BUS_KBPS:
            self._error_flags |= ERROR_WARNING | BUS_ERROR
            return
        stamp = b""
        if self._timestamps:
            stamp = b"%04X" % (time.monotonic_ns() // 1_000_000 % TIMESTAMP_MODULUS_MS)
        self._line.send(
            b"".join(
                b"t%03X%d%s%s\r" % (number, len(data), data.hex().upper().encode(), stamp)
                for number, data in frames
            )
        )

    def _answer(self, line: bytes) -> bytes:
        # Some hosts send line feeds too, and empty lines to wake an adapter up.
        text = line.strip(b"\n").decode("ascii", errors="replace")
        if not text:
            return CR
        if len(text) > LONGEST:
            return BELL
        command = self._commands.get(text[0])
        return BELL if command is None else command(text[1:])

    def _set_bitrate(self, rest: str) -> bytes:
        if self._is_open or len(rest) != 1 or rest not in "012345678":
            return BELL
        self._kbps = BITRATES[int(rest)]
        return CR

    def _set_timing(self, rest: str) -> bytes:
        """BTR0 and BTR1 of the SJA1000 at 8 MHz: tell which bitrate that is."""
        if self._is_open or _number(rest, 4) is None:
            return BELL
        btr0, btr1 = bytes.fromhex(rest)
        quanta = 3 + (btr1 & 0x0F) + (btr1 >> 4 & 0x07)
        self._kbps = 8000 // ((1 + (btr0 & 0x3F)) * quanta)
        return CR

    def _open(self, rest: str, *, listen_only: bool) -> bytes:
        if rest or self._is_open or self._kbps is None:
            return BELL
        self._is_open, self._listen_only = True, listen_only
        self._error_flags = 0
        return CR

    def _close_channel(self, rest: str) -> bytes:
        if rest or not self._is_open:
            return BELL
        self._is_open = False
        return CR

    def _transmit(self, rest: str, *, digits: int, remote: bool) -> bytes:
        number = _number(rest[:digits], digits)
        length = _number(rest[digits : digits + 1], 1)
        body = rest[digits + 1 :]
        if not self._is_open or self._listen_only or number is None or length is None or length > 8:
            return BELL
        if number > (STANDARD_LIMIT if digits == 3 else 0x1FFFFFFF):
            return BELL
        if body != "" if remote else (length > 0 or body != "") and _number(body, 2 * length) is None:
            return BELL
        if self._kbps != BUS_KBPS:
            self._error_flags |= ERROR_WARNING | BUS_ERROR
        elif digits == 3 and not remote:  # the board hears nothing else
            self._received.append((number, bytes.fromhex(body)))
        return b"z\r" if digits == 3 else b"Z\r"

    def _flags(self, rest: str) -> bytes:
        if rest or not self._is_open:
            return BELL
        flags, self._error_flags = self._error_flags, 0
        return b"F%02X\r" % flags

    def _set_timestamps(self, rest: str) -> bytes:
        if self._is_open or rest not in {"0", "1"}:
            return BELL
        self._timestamps = rest == "1"
        return CR

    def _filter(self, rest: str, everything: str) -> bytes:
        """Only the setting that lets everything pass is known; another one is refused, not ignored."""
        return BELL if self._is_open or rest.upper() != everything else CR


def _number(text: str, digits: int) -> int | None:
    """The value of exactly so many hexadecimal digits, or None."""
    if len(text) != digits or digits == 0 or not set(text) <= set("0123456789abcdefABCDEF"):
        return None
    return int(text, 16)
