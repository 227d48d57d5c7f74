"""A part of the page."""

from dataclasses import dataclass

from impid_host.report.page.plot import Plot
from impid_host.report.page.tables import PageTable


@dataclass(frozen=True, slots=True)
class Section:
    """A part of the page.

    Attributes:
        name: the heading; about: how to read it; shut: folded until asked for (print opens it).
    """

    name: str
    about: str
    tables: tuple[PageTable, ...] = ()
    plots: tuple[Plot, ...] = ()
    words: tuple[str, ...] = ()
    shut: bool = False
