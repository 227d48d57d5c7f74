"""What a reader noticed and coped with: said once, never silent, never fatal."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class StudyWarning(UserWarning):
    """Something in a file was odd, and this is what was done about it."""


def notice(text: str) -> None:
    """Warn about an oddity in a file; `text` names the file and what was done."""
    warnings.warn(text, StudyWarning, stacklevel=3)


@contextmanager
def notices_as_lines(echo: Callable[[str], object]) -> Iterator[None]:
    """Hand every `StudyWarning` raised inside to `echo` as one line; other warnings pass through.

    Commands use it as `with notices_as_lines(lambda line: click.echo(line, err=True)): ...`.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("always", StudyWarning)
        show = warnings.showwarning

        def show_line(message, category, *place):  # type: ignore[no-untyped-def]
            if issubclass(category, StudyWarning):
                echo(f"warning: {message}")
            else:
                show(message, category, *place)

        warnings.showwarning = show_line
        yield
