"""A bus that python-can reaches: `udp_multicast`, which needs nothing but a network stack, or `socketcan`."""

import contextlib
import socket
import time
from collections import deque
from typing import Any

import can

from hil_sim.carriers.protocol import CanFrame
from hil_sim.errors import SimError

# A bus does not tell who listens; a host pings ten times a second.
SILENCE_S = 2.0
ECHOES = 4096
UDP_GROUP, UDP_PORT = "239.74.163.2", 43113  # python-can's own
SOCKET_BYTES = 4 << 20  # its own echoes wait there too, in front of what the client says
REMEDY = {
    "socketcan": "make the interface first (ip link add dev vcan0 type vcan && ip link set vcan0 up), "
    "or use --carrier slcan, which needs none",
    "udp_multicast": "name a multicast group that this machine can join, or use --carrier slcan",
}


class BusCarrier:
    """Implements `CanCarrier` on an interface of python-can."""

    def __init__(self, interface: str, channel: str, **options: int) -> None:
        """Joins the bus.

        Raises:
            SimError: the machine has no such interface.
        """
        self._config: dict[str, str | int] = {"interface": interface, "channel": channel, **options}
        self._bus: can.BusABC | None = None
        self._heard_s = time.monotonic() - SILENCE_S
        self._dropped = 0
        # Multicast brings a socket its own frames too; on a bus nobody hears himself.
        self._echoes: deque[CanFrame] = deque(maxlen=ECHOES if interface == "udp_multicast" else 0)
        self.plug()

    @property
    def address(self) -> str:
        """The channel."""
        return str(self._config["channel"])

    @property
    def config(self) -> dict[str, str | int]:
        """Keyword arguments with which `can.Bus` joins."""
        return dict(self._config)

    @property
    def connected(self) -> bool:
        """Somebody spoke within the last two seconds."""
        return self._bus is not None and time.monotonic() - self._heard_s < SILENCE_S

    @property
    def dropped(self) -> int:
        """Frames that the interface had no room for."""
        return self._dropped

    def pull(self) -> None:
        """The board leaves the bus."""
        if self._bus is not None:
            self._bus.shutdown()
        self._bus = None

    def plug(self) -> None:
        """The board joins the bus."""
        options: dict[str, Any] = dict(self._config)
        if options["interface"] == "udp_multicast":
            options["hop_limit"] = 0  # never beyond this machine
        try:
            self._bus = can.Bus(**options)
        except (can.CanError, OSError) as error:
            interface = options["interface"]
            raise SimError(f"{self.address}: no {interface} here ({error}); {REMEDY[interface]}") from None
        own = getattr(self._bus, "socket", None) or getattr(
            getattr(self._bus, "_multicast", None), "_socket", None
        )
        if isinstance(own, socket.socket):
            with contextlib.suppress(OSError):
                own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SOCKET_BYTES)

    def close(self) -> None:
        """Leaves the bus for good."""
        self.pull()

    def receive(self, timeout_s: float) -> list[CanFrame]:
        """Waits for frames, at most timeout_s."""
        if self._bus is None:
            time.sleep(timeout_s)
            return []
        frames: list[CanFrame] = []
        message = self._bus.recv(timeout_s)
        while message is not None:
            frame = (message.arbitration_id, bytes(message.data))
            plain = not (message.is_extended_id or message.is_remote_frame or message.is_error_frame)
            if not self._is_echo(frame):
                self._heard_s = time.monotonic()
                frames += [frame] if plain else []
            message = self._bus.recv(0.0)
        return frames

    def _is_echo(self, frame: CanFrame) -> bool:
        """Echoes come in the order of sending; those before this one were lost."""
        if frame not in self._echoes:
            return False
        while self._echoes.popleft() != frame:
            pass
        return True

    def send(self, frames: list[CanFrame]) -> None:
        """Puts frames on the bus."""
        if self._bus is None:
            return
        for number, data in frames:
            try:
                self._bus.send(can.Message(arbitration_id=number, data=data, is_extended_id=False))
            except can.CanError:
                self._dropped += 1
            else:
                self._echoes.append((number, data))
