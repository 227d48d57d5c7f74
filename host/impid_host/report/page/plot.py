"""A figure as data: the page draws it as SVG that can be zoomed, `journal` as PDF or SVG for print."""

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np

from impid_host.signals.arrays import Floats

# A role has a colour and a dash, so that lines are told apart without colour as well.
Role = Literal["first", "second", "third", "floor"]
COLOURS: dict[Role, str] = {
    "first": "#d55e00",
    "second": "#0072b2",
    "third": "#00704f",
    "floor": "#333333",
}
DASHES: dict[Role, tuple[float, ...]] = {
    "first": (5, 2.5),
    "second": (),
    "third": (8, 3, 2, 3),
    "floor": (),
}
SpanKind = Literal["event", "held out"]
# Points of a line that a page or a printed column can show; signals are low-passed far below this.
_MOST_POINTS = 3000


@dataclass(frozen=True, slots=True)
class Line:
    """A line, or dots.

    Attributes:
        x, y: (N,), in the plot's units; rows that are not finite break the line.
        name: in the legend; "" for none.
        faint: one of many draws from a distribution.
    """

    x: Floats
    y: Floats
    name: str
    role: Role
    dots: bool = False
    faint: bool = False


@dataclass(frozen=True, slots=True)
class Band:
    """A 95 % band around a line: x, low, high, (N,) each."""

    x: Floats
    low: Floats
    high: Floats
    role: Role


@dataclass(frozen=True, slots=True)
class Span:
    """A stretch of the x axis that needs a word."""

    low: float
    high: float
    name: str
    kind: SpanKind


@dataclass(frozen=True, slots=True)
class Plot:
    """One pair of axes.

    Attributes:
        key: file name of the figure, without ending.
        title: what is shown; caption: how to read it.
        square: one unit is as long along y as along x.
        y_range: fixed limits, where the data should not choose them.
    """

    key: str
    title: str
    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    bands: tuple[Band, ...] = ()
    spans: tuple[Span, ...] = ()
    caption: str = ""
    square: bool = False
    y_range: tuple[float, float] | None = None

    @property
    def file_name(self) -> str:
        """The key without what some file systems forbid."""
        return re.sub(r"[^\w.-]", "-", self.key)

    @property
    def drawn(self) -> tuple[Line, ...]:
        """The lines from below to above: faint ones, then solid, then dashed, so that none hides another."""
        return tuple(sorted(self.lines, key=lambda line: (not line.faint, bool(DASHES[line.role]))))

    def limits(self) -> tuple[float, float, float, float]:
        """x0, x1, y0, y1 around everything finite, with a margin along y."""
        x = _finite([line.x for line in self.lines] + [band.x for band in self.bands])
        y = _finite(
            [line.y for line in self.lines] + [part for band in self.bands for part in (band.low, band.high)]
        )
        aside = self.square or any(line.dots for line in self.lines)
        x0, x1 = _opened(float(x.min()), float(x.max()), 0.05 if aside else 0.0)
        y0, y1 = self.y_range or _opened(float(y.min()), float(y.max()), 0.05)
        return x0, x1, y0, y1


def _finite(parts: list[Floats]) -> Floats:
    values = np.concatenate([np.ravel(part) for part in parts]) if parts else np.zeros(0)
    kept: Floats = values[np.isfinite(values)]
    return kept if len(kept) else np.array([0.0, 1.0])


def _opened(low: float, high: float, share: float) -> tuple[float, float]:
    if high <= low:
        half = 0.5 * abs(low) or 0.5
        return low - half, high + half
    return low - share * (high - low), high + share * (high - low)


def thinned(x: Floats, *channels: Floats) -> tuple[Floats, ...]:
    """Every k-th row, so that at most `_MOST_POINTS` are left; (N,) each."""
    step = max(1, -(-len(x) // _MOST_POINTS))
    return tuple(values[::step] for values in (x, *channels))
