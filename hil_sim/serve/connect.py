"""From the command line's choice of carrier to the carrier, plugged into the board."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from hil_sim.carriers.bus import UDP_GROUP, UDP_PORT, BusCarrier
from hil_sim.carriers.pty import PtyCarrier
from hil_sim.carriers.slcan import SlcanCarrier
from hil_sim.carriers.tcp import TcpCarrier
from hil_sim.errors import SimError
from hil_sim.faults.line import FaultyLine
from hil_sim.serve.attachment import Attachment, CanAttachment, SerialAttachment

CarrierName = Literal["pty", "tcp", "slcan", "udp_multicast", "socketcan"]
CARRIERS: tuple[CarrierName, ...] = get_args(CarrierName)
DEFAULT_CARRIER: CarrierName = "pty" if PtyCarrier.available else "tcp"


@dataclass(frozen=True)
class Connection:
    """Which carrier, where.

    Attributes:
        carrier: its name.
        address: HOST:PORT of tcp, GROUP:PORT of udp_multicast, the interface of socketcan; None: a default.
        link: pty and slcan: a symbolic link to the terminal; None: none.
    """

    carrier: CarrierName = DEFAULT_CARRIER
    address: str | None = None
    link: Path | None = None


def connect(connection: Connection, bytes_per_ms: int, clock_us: Callable[[], int]) -> Attachment:
    """Takes the carrier up.

    Args:
        connection: which one.
        bytes_per_ms: of the serial line.
        clock_us: shows board time.

    Raises:
        SimError: it cannot be had on this machine, or an option does not belong to it.
    """
    carrier, address = connection.carrier, connection.address
    if connection.link is not None and carrier not in {"pty", "slcan"}:
        raise SimError(f"--link: {carrier} has no terminal; leave --link away, or use --carrier pty or slcan")
    if address is not None and carrier in {"pty", "slcan"}:
        raise SimError(
            f"--address: {carrier} takes the next free terminal; use --link for a name of your own"
        )
    match carrier:
        case "pty":
            return SerialAttachment(PtyCarrier(connection.link), bytes_per_ms, clock_us)
        case "tcp":
            return SerialAttachment(TcpCarrier(*_place(address, "127.0.0.1", 0)), bytes_per_ms, clock_us)
        case "slcan":
            line = FaultyLine(PtyCarrier(connection.link), clock_us)
            return CanAttachment(SlcanCarrier(line), clock_us, line)
        case "udp_multicast":
            group, port = _place(address, UDP_GROUP, UDP_PORT)
            return CanAttachment(BusCarrier("udp_multicast", group, port=port), clock_us)
        case "socketcan":
            return CanAttachment(BusCarrier("socketcan", address or "vcan0"), clock_us)


def _place(address: str | None, host: str, port: int) -> tuple[str, int]:
    """HOST, HOST:PORT or :PORT, with what to take for a part that is missing."""
    if address is None:
        return host, port
    given, colon, number = address.rpartition(":")
    if not colon:
        return address, port
    if not number.isdecimal() or int(number) > 65535:
        raise SimError(f"--address {address}: the port must be a number up to 65535, as in {host}:4000")
    return given or host, int(number)
