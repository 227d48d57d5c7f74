"""`impid-host device update`: another firmware for the board, without a probe."""

from contextlib import closing
from pathlib import Path

import click
from rich.progress import Progress

from impid_host.cli.link_options import address_of, link_options
from impid_host.link.board_info import build_name
from impid_host.link.client import BoardClient
from impid_host.link.update import read_firmware
from impid_host.link.update import update as send


@click.command()
@link_options
@click.argument("firmware", type=click.Path(path_type=Path))
def update(*, port: str | None, can: str | None, baud: int | None, firmware: Path) -> None:
    """Send FIRMWARE (firmware.impid, as `pio run` writes it) to the board, and start it.

    Settings and calibration stay. The power may fail at any moment: the board then starts what it had.

    \b
    Example:
      impid-host device update --port auto .pio/build/nucleo_f446re/firmware.impid
    """
    content = read_firmware(firmware)
    with (
        closing(BoardClient(address_of(port, can, baud).open())) as client,
        Progress(transient=True) as bars,
    ):
        bar = bars.add_task("sending", total=None)
        board = send(client, content, lambda done, total: bars.update(bar, completed=done, total=total))
    click.echo(f"the board runs {build_name(board)}")
