"""`impid-host device bring-up`: the bench test of a board that has never run before."""

import sys
from contextlib import closing
from pathlib import Path

import click

from impid_host.bring_up.board import BenchBoard
from impid_host.bring_up.report import closing as closing_lines
from impid_host.bring_up.report import heading, row
from impid_host.bring_up.result import Result
from impid_host.bring_up.run import bring_up
from impid_host.errors import InputError, LinkError
from impid_host.link.address import Address
from impid_host.link.client import BoardClient

# Nucleo's name and the chip's of each place of the wire (docs/hardware.md).
PLACES = {"encoder 1 A": "CN7-17 (PA15)", "encoder 2 A": "A0 (PA0)", "x": "A5 (PC0)", "y": "A4 (PC1)"}
EDGE = "D12 (PA6)"


class _Asking:
    """The one at the keyboard."""

    def _ask(self, text: str) -> bool:
        answer = click.prompt(f"{text}; Enter, or s to skip", default="", show_default=False, err=True)
        return not answer.strip().lower().startswith("s")

    def bare(self) -> bool:
        """Before the chip's resistors drive the inputs."""
        return self._ask("take every wire off the encoder, fault and sync inputs")

    def wire(self, signal: str) -> bool:
        """A place for the wire."""
        sensor = ", the sensor's own wire off" if signal in ("x", "y") else ""
        return self._ask(f"wire from {EDGE} to {PLACES[signal]}{sensor}")

    def unwire(self) -> bool:
        """Before what comes next."""
        return self._ask("take the wire off, and put the sensor's back")

    def unplug(self) -> bool:
        """Power lost."""
        return self._ask("after Enter pull the USB plug at any moment, and put it back")


@click.command("bring-up")
@click.option("--port", metavar="PORT", required=True, help="Serial device, or `auto`.")
@click.option("--baud", type=int, help="Speed of the serial line. Default: tried out, 921600 first.")
@click.option(
    "--minutes",
    default=60.0,
    show_default=True,
    type=click.FloatRange(min=0.05),
    help="How long the clock is watched.",
)
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE.md", help="Where the report goes too.")
def bring_up_command(*, port: str, baud: int | None, minutes: float, out: Path | None) -> None:
    """Measure a new board on the bench, with one jumper wire, and print a report to send back.

    \b
    Exit status 1 if a result is out of its bound.
    Example:
      impid-host device bring-up --port auto --minutes 60 --out board.md
    """
    if out is not None and out.exists():
        raise InputError(out, "exists already", "choose another name or move it away")
    address = Address(port=port, baud=baud)
    lines: list[str] = []

    def say(more: list[str]) -> None:
        lines.extend(more)
        click.echo("\n".join(more))
        if out is not None:  # at once: a board that falls silent must not cost what came before
            out.write_text("\n".join(lines) + "\n", encoding="utf-8")

    results: list[Result] = []
    with closing(BoardClient(address.open())) as client:
        board = BenchBoard(client)
        client.stop()
        say(heading(client.info()))
        if not board.knows_bench:
            raise LinkError(
                f"{client.name}: this board's firmware has no bench test, so nothing was measured; "
                "update it if it is older than that (the Nucleo-G474RE has none yet)"
            )
        for result in bring_up(board, _Asking(), address.open, minutes):
            results.append(result)
            say([row(result)])
    say(closing_lines(results))
    if any(result.passed is False for result in results):
        sys.exit(1)
