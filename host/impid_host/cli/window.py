"""The option --window of commands that read recordings."""

from collections.abc import Callable
from typing import Any, TypeVar

import click

from impid_host.recording.records import Window

Command = TypeVar("Command", bound=Callable[..., Any])


def window_option(command: Command) -> Command:
    """Adds `--window`, a `Window` or None."""
    return click.option(
        "--window",
        metavar="FROM:TO",
        callback=_window,
        help="Only these seconds since the recording's beginning, on the PC's clock.",
    )(command)


def _window(_: click.Context, __: click.Parameter, value: str | None) -> Window | None:
    if value is None:
        return None
    start, colon, stop = value.partition(":")
    try:
        window = Window(float(start or 0), float(stop or "inf"))
    except ValueError:
        window = Window(-1, -1)
    if not colon or not 0 <= window.start_s < window.stop_s:
        raise click.BadParameter("give two times in seconds, the earlier first: 600:660, 600: or :60")
    return window
