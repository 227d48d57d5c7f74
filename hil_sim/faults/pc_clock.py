"""Runs a Python program on a PC whose clock jumps.

    python -m hil_sim.faults.pc_clock 3600 2 impid-host record --port /dev/pts/3 --out free_01.mcap

The wall clock that Python's `time` module shows jumps by so many seconds, so many seconds after the start, as
when a time server corrects it. The monotonic clock does not, because no system's does, and the machine's own
is not touched. `datetime.now` reads the clock past the `time` module and does not see the jump.
"""

import runpy
import shutil
import sys
import time

import click

from hil_sim.errors import SimError

NS_PER_S = 1_000_000_000


def install(jump_s: float, after_s: float) -> None:
    """From after_s from now on `time.time` and `time.time_ns` show jump_s more."""
    true_ns = time.time_ns
    begin_ns = time.monotonic_ns() + round(NS_PER_S * after_s)
    jump_ns = round(NS_PER_S * jump_s)

    def shown_ns() -> int:
        return true_ns() + (jump_ns if time.monotonic_ns() >= begin_ns else 0)

    time.time_ns = shown_ns
    time.time = lambda: shown_ns() / NS_PER_S


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("jump_s", type=float)
@click.argument("after_s", type=float)
@click.argument("program")
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def main(jump_s: float, after_s: float, program: str, arguments: tuple[str, ...]) -> None:
    """Run PROGRAM, a Python script, with the wall clock JUMP_S off from AFTER_S after the start."""
    path = shutil.which(program) or program
    sys.argv = [path, *arguments]
    install(jump_s, after_s)
    try:
        runpy.run_path(path, run_name="__main__")
    except FileNotFoundError:
        raise SimError(f"{program}: no such program; name a Python script") from None


if __name__ == "__main__":
    try:
        main(standalone_mode=False)
    except (SimError, click.ClickException) as error:
        click.echo(f"impid-sim: {error}", err=True)
        sys.exit(1)
