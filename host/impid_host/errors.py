"""The errors a user can cause; each says what was wrong, where, and what to do about it.

Anything else that escapes a command is a defect in impid itself.
"""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any


class ImpidError(Exception):
    """Base of every error that a user can act on; the command line prints it as one line.

    >>> import impid_host as impid
    >>> try:
    ...     impid.read_study("no/such/study")
    ... except impid.ImpidError as error:
    ...     print(type(error).__name__)
    InputError
    """


class InputError(ImpidError):
    """A file that cannot be used as it is.

    `where` is the file as it was named, with the row.

    >>> error = InputError("study/free_01/robot.csv", "t goes back", "sort the rows", row=1047)
    >>> print(error)
    study/free_01/robot.csv, row 1047: t goes back; sort the rows
    >>> error.row, error.remedy
    (1047, 'sort the rows')

    Args:
        path: the file.
        what: what is wrong, in plain words.
        remedy: what the user can do about it.
        row: 1-based line of the file, header included, where that is known.
        check: the name under which `impid-host check` lists such a mistake ("time.jump"), where it has one.
        evidence: the numbers behind it, by name.
    """

    def __init__(
        self,
        path: Path | str,
        what: str,
        remedy: str,
        *,
        row: int | None = None,
        check: str | None = None,
        evidence: Mapping[str, float] | None = None,
    ) -> None:
        self.path = Path(path)
        self.row = row
        self.check = check
        self.evidence = dict(evidence or {})
        self.what = what
        self.remedy = remedy
        self._given = path
        self.where = f"{path}" if row is None else f"{path}, row {row}"
        super().__init__(f"{self.where}: {what}; {remedy}")

    def __reduce__(self) -> tuple[Any, ...]:
        """Sent to another process with its parts; an exception knows only its message otherwise."""
        make = partial(type(self), row=self.row, check=self.check, evidence=self.evidence)
        return make, (self._given, self.what, self.remedy)


class LinkError(ImpidError):
    """The board cannot be reached, or it answers in a way that this version does not understand."""


class UndeterminedError(ImpidError):
    """The data do not determine what was asked for; a number would be a guess.

    >>> from dataclasses import replace
    >>> import impid_host as impid
    >>> study = impid.example_study()
    >>> replace(study, trials=study.of_kind("mass-spring")).fit()  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    impid_host.errors.UndeterminedError: study example: no free trial and no [prior] alpha in setup.toml, ...
    """
