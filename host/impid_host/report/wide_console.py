"""The console that tables are printed on: never so narrow that a name or a value would be cut."""

from rich.console import Console

LEAST_WIDTH = 120


def table_console() -> Console:
    """Standard output; where it is no terminal (a pipe, a log), wide enough for every table."""
    console = Console()
    return console if console.is_terminal else Console(width=max(console.width, LEAST_WIDTH))
