"""A CAN bus by python-can, read by a thread that does nothing else.

Frames are stamped when the adapter gives them, and handed on in small groups; an answer ends its group, so
that the group's stamp is the answer's.
"""

import contextlib
import socket
import time
from typing import Any, Self

import can

from impid_host.errors import LinkError
from impid_host.link.inbox import POLL_S, Inbox
from impid_host.link.link import Chunk
from impid_host.link.slcan_lines import CheckedLines
from impid_host.wire.can_frames import ERROR, EXTENDED, REMOTE, pack_frame, unpack_frames
from impid_host.wire.carrier import CAN
from impid_host.wire.messages import PONG, RESPONSE

DEFAULT_BITRATE = 1_000_000
_ANSWERS = frozenset({PONG.frame_id, RESPONSE.frame_id})
_GROUP_S = 0.005
_GROUP_FRAMES = 64
_SEND_S = 0.2
_SOCKET_BYTES = 4 << 20
_SO_RCVBUFFORCE = 33  # Linux; Python does not name it
# A garbled line of an adapter is one frame lost; as many in a row mean that the adapter is gone.
_FAILURES = 10
# A USB adapter is ready at once; python-can waits two seconds for boards that restart when opened.
_SLCAN_OPEN_S = 0.05


class CanLink:
    """An open bus."""

    carrier = CAN

    def __init__(self, bus: can.BusABC, name: str) -> None:
        self.name = name
        self._bus = bus
        self._inbox = Inbox(name, self._read_on, f"{name}: the CAN adapter is gone; check its cable")

    @classmethod
    def open(cls, address: str) -> Self:
        """Open INTERFACE:CHANNEL[@BITRATE][,OPTION=VALUE...], any interface of python-can by its name.

        Options go to the interface as they are. INTERFACE alone takes the rest from python-can's own
        configuration file.

        Raises:
            LinkError: there is no such interface or channel, or it cannot be opened.
        """
        interface, channel, options = parse_address(address)
        try:
            bus = can.Bus(interface=interface, channel=channel, **options)
        except (
            can.CanError,
            can.CanInterfaceNotImplementedError,
            OSError,
            ValueError,
            TypeError,
            ImportError,
        ) as error:
            raise LinkError(
                f"{address}: cannot be opened as a CAN bus ({_first_line(error)}); name INTERFACE:CHANNEL as "
                "python-can does, for instance socketcan:can0 or slcan:/dev/ttyACM0"
            ) from error
        _give_room(bus)
        if interface == "slcan":
            bus.serialPortOrig = CheckedLines(bus.serialPortOrig)  # type: ignore[attr-defined]
        return cls(bus, address)

    def send(self, data: bytes) -> Chunk:
        """Send packed frames.

        Raises:
            LinkError: the bus or its adapter is gone, or the bus is off.
        """
        now_ns = time.monotonic_ns()
        stamped = b""
        for frame in unpack_frames(data):
            identifier, body = int(frame["identifier"]), frame["data"].tobytes()[: frame["dlc"]]
            stamped += pack_frame(now_ns, identifier, body)
            message = can.Message(
                arbitration_id=identifier & ~EXTENDED, data=body, is_extended_id=bool(identifier & EXTENDED)
            )
            try:
                self._bus.send(message, timeout=_SEND_S)
            except (can.CanError, OSError) as error:
                raise LinkError(
                    f"{self.name}: the bus does not take a frame ({_first_line(error)}); check cable, "
                    "terminators and bit rate"
                ) from error
        return Chunk(monotonic_ns=now_ns, wall_ns=time.time_ns(), data=stamped)

    def receive(self, timeout_s: float) -> Chunk | None:
        """The next group of frames, or None when nothing came in time.

        Raises:
            LinkError: the adapter is gone and every frame that came before has been taken.
        """
        return self._inbox.take(timeout_s)

    def close(self) -> None:
        """Stop reading and release the adapter; one that is gone already is no error."""
        self._inbox.stop()
        with contextlib.suppress(can.CanError, OSError, ValueError):
            self._bus.shutdown()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _read_on(self, inbox: Inbox) -> None:
        group: list[bytes] = []
        hand_on_ns, failures = 0, 0
        while not inbox.closing.is_set() and failures < _FAILURES:
            left_s = max(0.0, (hand_on_ns - time.monotonic_ns()) * 1e-9) if group else POLL_S
            try:
                message = self._bus.recv(left_s)
            except (can.CanError, OSError, ValueError, IndexError, TypeError):
                failures += 1
                inbox.closing.wait(0.005)
                continue
            failures = 0
            now_ns = time.monotonic_ns()
            if message is not None:
                hand_on_ns = hand_on_ns if group else now_ns + int(_GROUP_S * 1e9)
                group.append(pack_frame(now_ns, *_content(message)))
            answered = message is not None and message.arbitration_id in _ANSWERS
            if group and (answered or now_ns >= hand_on_ns or len(group) >= _GROUP_FRAMES):
                inbox.put(Chunk(now_ns, time.time_ns(), b"".join(group)))
                group = []
        if group:
            inbox.put(Chunk.now(b"".join(group)))


def _give_room(bus: can.BusABC) -> None:
    """The system's usual buffer holds 130 ms of a board's frames; a busy machine needs more."""
    own = getattr(bus, "socket", None) or getattr(getattr(bus, "_multicast", None), "_socket", None)
    if not isinstance(own, socket.socket):
        return
    for option in (_SO_RCVBUFFORCE, socket.SO_RCVBUF):  # the first is for those who may exceed the limit
        with contextlib.suppress(OSError):
            own.setsockopt(socket.SOL_SOCKET, option, _SOCKET_BYTES)
            return


def parse_address(address: str) -> tuple[str, str | None, dict[str, Any]]:
    """Interface, channel and options of INTERFACE:CHANNEL[@BITRATE][,OPTION=VALUE...]."""
    place, *extras = address.split(",")
    interface, _, rest = place.partition(":")
    channel, _, bitrate = rest.rpartition("@")
    if not (channel and bitrate.isdigit()):
        channel, bitrate = rest, str(DEFAULT_BITRATE)
    options: dict[str, Any] = {"bitrate": int(bitrate)} if channel else {}
    if interface == "slcan":
        options["sleep_after_open"] = _SLCAN_OPEN_S
    for extra in extras:
        name, _, value = extra.partition("=")
        options[name.strip()] = _value(value.strip())
    return interface, channel or None, options


def _value(text: str) -> int | float | bool | str:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return text


def _content(message: can.Message) -> tuple[int, bytes]:
    flags = EXTENDED * message.is_extended_id | REMOTE * message.is_remote_frame
    return message.arbitration_id | flags | ERROR * message.is_error_frame, bytes(message.data[:8])


def _first_line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
