"""Options of every command that talks to a board."""

from collections.abc import Callable
from typing import Any

import click

from impid_host.link.address import Address

Command = Callable[..., Any]


def link_options(command: Command) -> Command:
    """Adds --port, --can and --baud."""
    for option in reversed(
        (
            click.option(
                "--port",
                metavar="PORT",
                help="Serial device, socket://host:port, or `auto` to find the board by its USB id.",
            ),
            click.option(
                "--can",
                metavar="INTERFACE:CHANNEL[@BITRATE][,OPTION=VALUE]",
                help="CAN bus of any python-can interface, e.g. socketcan:can0, slcan:/dev/ttyACM0.",
            ),
            click.option(
                "--baud", type=int, help="Speed of the serial line. Default: tried out, 921600 first."
            ),
        )
    ):
        command = option(command)
    return command


def address_of(port: str | None, can: str | None, baud: int | None) -> Address:
    """The address that the options name; a usage error when they contradict each other."""
    if port is not None and can is not None:
        raise click.UsageError("give either --port or --can")
    if can is not None and baud is not None:
        raise click.UsageError("--baud is for a serial line; the bit rate of a bus stands behind @")
    return Address(port=port, can=can, baud=baud)
