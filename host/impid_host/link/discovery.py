"""Finds the board's serial port, and the speed at which it talks."""

import random
import time
from collections.abc import Iterable
from typing import Protocol

from serial.tools import list_ports

from impid_host.errors import LinkError
from impid_host.link.port import SerialLink
from impid_host.wire.carrier import SERIAL
from impid_host.wire.messages import ITEM, OPCODE, SERIAL_BAUD

# Virtual COM ports of ST-LINK probes, USB vendor and product: V2-1, V2-1 without disk, V3E, V3, V3 with two
# ports, V3 without disk, V3PWR (STMicroelectronics, udev rules that come with STM32CubeProgrammer).
ST_LINK = frozenset((0x0483, product) for product in (0x374B, 0x3752, 0x374E, 0x374F, 0x3753, 0x3754, 0x3757))
# The board's own first, then what adapters and older boards are set to.
BAUDS = (SERIAL_BAUD, 460800, 1_000_000, 2_000_000, 230400, 115200)
# Two statuses come in that time, whether or not the question is understood.
_LISTEN_S = 0.25


class _Port(Protocol):
    device: str
    vid: int | None
    pid: int | None


def find_port(ports: Iterable[_Port] | None = None) -> str:
    """The device of the one board that is plugged in, by its USB id.

    Raises:
        LinkError: there is none, or more than one.
    """
    present = list(list_ports.comports() if ports is None else ports)
    found = sorted({port.device for port in present if (port.vid, port.pid) in ST_LINK})
    if len(found) == 1:
        return found[0]
    if found:
        raise LinkError(
            f"several boards are plugged in: {', '.join(found)}; name one with --port, or unplug the others"
        )
    others = ", ".join(sorted(port.device for port in present)) or "none"
    raise LinkError(
        f"no board was found by its USB id (ST-LINK); ports on this machine: {others}; check the cable, or "
        "name the port with --port"
    )


def find_baud(link: SerialLink) -> int:
    """Leave the line at the speed at which a board answers, or says its status unasked; returns that speed.

    The port stays open throughout: some boards restart when it is opened.

    Raises:
        LinkError: nothing that could be understood came at any speed, or the port is gone.
    """
    for baud in BAUDS:
        link.set_baud(baud)
        decoder = SERIAL.decoder()
        link.send(
            SERIAL.preamble
            + SERIAL.encode_command(random.randrange(1 << 16), OPCODE["INFO"], ITEM["BOOT_ID"], 0)
        )
        deadline = time.monotonic() + _LISTEN_S
        while (left := deadline - time.monotonic()) > 0:
            chunk = link.receive(left)
            if chunk is not None:
                decoder.feed(chunk.data)
            if decoder.counts.good_frames:
                return baud
    tried = ", ".join(map(str, BAUDS))
    raise LinkError(
        f"{link.name}: no answer from a board at any of the speeds {tried}; check that this is the board's "
        "port, and that the board runs impid firmware"
    )
