"""A `Plot` as inline SVG: readable as it stands, zoomed by `page.js`, which moves the inner view box.

The lines are drawn in whole numbers from 0 to `_UNITS` along both axes, which keeps the page small.
"""

import json
from collections.abc import Iterator, Sequence
from html import escape

import numpy as np

from impid_host.report.page.plot import COLOURS, DASHES, Band, Line, Plot, Span
from impid_host.signals.arrays import Floats

_UNITS = 10000
WIDTH, LEFT, RIGHT, TOP, BOTTOM = 900, 78, 14, 18, 42
Limits = tuple[float, float, float, float]


def svg(plot: Plot) -> str:
    """The `<svg>` element of a plot; its limits stand in `data-limits`."""
    limits = _squared(plot)
    height = 470 if plot.square else 250
    width = 520 if plot.square else WIDTH
    inner = (LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM)
    marks = [[0.5 * (s.low + s.high), s.name] for s in plot.spans if s.kind == "event"]
    parts = [
        f'<svg class="plot" viewBox="0 0 {width} {height}" role="img" '
        f'data-limits="{escape(json.dumps([float(f"{v:.9g}") for v in limits]))}" '
        f'data-marks="{escape(json.dumps(marks))}" style="max-width:{width}px">',
        f"<title>{escape(plot.title)}</title>",
        f'<g class="axes">{"".join(_axes(limits, inner, marks))}</g>',
        f'<svg class="data" x="{inner[0]}" y="{inner[1]}" width="{inner[2]}" height="{inner[3]}" '
        f'viewBox="0 0 {_UNITS} {_UNITS}" preserveAspectRatio="none">',
        *(_span(span, limits) for span in plot.spans),
        *(_band(band, limits) for band in plot.bands),
        *(_line(line, limits) for line in plot.drawn),
        "</svg>",
        f'<text class="label" x="{inner[0] + inner[2] / 2}" y="{height - 6}" text-anchor="middle">'
        f"{escape(plot.x_label)}</text>",
        f'<text class="label" transform="translate(14 {inner[1] + inner[3] / 2}) rotate(-90)" '
        f'text-anchor="middle">{escape(plot.y_label)}</text>',
        "</svg>",
    ]
    return "".join(parts)


def swatch(line: Line) -> str:
    """A line's piece of the legend."""
    dash = "" if line.dots else " ".join(f"{2 * part:g}" for part in DASHES[line.role])
    return (
        '<svg class="swatch" viewBox="0 0 34 10" aria-hidden="true">'
        f'<path d="M1 5h32" stroke="{COLOURS[line.role]}" stroke-width="2.4" fill="none" '
        f'stroke-dasharray="{dash}"/></svg>'
    )


def _squared(plot: Plot) -> Limits:
    """The limits, opened along one axis where one unit has to be as long along both."""
    x0, x1, y0, y1 = plot.limits()
    if not plot.square:
        return x0, x1, y0, y1
    width, height = 520 - LEFT - RIGHT, 470 - TOP - BOTTOM
    scale = max((x1 - x0) / width, (y1 - y0) / height)
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    return (
        x - 0.5 * scale * width,
        x + 0.5 * scale * width,
        y - 0.5 * scale * height,
        y + 0.5 * scale * height,
    )


def ticks(low: float, high: float, most: int) -> Floats:
    """Round numbers within the limits, `most` at most or a few less; `page.js` has the same rule."""
    raw = (high - low) / most
    power = 10.0 ** np.floor(np.log10(raw))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= raw * (1 - 1e-9))
    first = np.ceil(low / step - 1e-9)
    last = np.floor(high / step + 1e-9)
    result: Floats = np.arange(first, last + 1) * step
    return result


def _axes(limits: Limits, inner: Sequence[int], marks: Sequence[Sequence[object]]) -> Iterator[str]:
    x0, x1, y0, y1 = limits
    left, top, width, height = inner
    for value in ticks(x0, x1, 9):
        at = left + (value - x0) / (x1 - x0) * width
        yield f'<path class="grid" d="M{at:.1f} {top}v{height}"/>'
        yield f'<text x="{at:.1f}" y="{top + height + 16}" text-anchor="middle">{_number(value)}</text>'
    for value in ticks(y0, y1, 6):
        at = top + (y1 - value) / (y1 - y0) * height
        yield f'<path class="grid" d="M{left} {at:.1f}h{width}"/>'
        yield f'<text x="{left - 6}" y="{at + 4:.1f}" text-anchor="end">{_number(value)}</text>'
    for place, name in marks:
        at = left + (float(str(place)) - x0) / (x1 - x0) * width
        yield f'<text class="mark" x="{at:.1f}" y="{top - 5}" text-anchor="middle">{escape(str(name))}</text>'


def _number(value: float) -> str:
    return "0" if abs(value) < 1e-12 else f"{value:.6g}".replace("-", "−")


def _line(line: Line, limits: Limits) -> str:
    dash = "" if line.dots or line.faint else f' stroke-dasharray="{" ".join(map(str, DASHES[line.role]))}"'
    kind = "dots" if line.dots else "faint" if line.faint else "line"
    return f'<path class="{kind} {line.role}"{dash} d="{_path(line.x, line.y, limits, dots=line.dots)}"/>'


def _band(band: Band, limits: Limits) -> str:
    good = np.isfinite(band.low) & np.isfinite(band.high)
    if not good.any():
        return ""
    around = np.concatenate([band.x[good], band.x[good][::-1]])
    edge = np.concatenate([band.low[good], band.high[good][::-1]])
    return f'<path class="band {band.role}" d="{_path(around, edge, limits)}Z"/>'


def _span(span: Span, limits: Limits) -> str:
    low, high = _units(np.array([span.low, span.high]), limits[0], limits[1])
    return (
        f'<rect class="{span.kind.replace(" ", "-")}" x="{low}" y="0" width="{max(high - low, 1)}" '
        f'height="{_UNITS}"><title>{escape(span.name)}</title></rect>'
    )


def _units(values: Floats, low: float, high: float) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
    scaled = _UNITS * (values - low) / (high - low)
    return np.round(np.clip(scaled, -10 * _UNITS, 11 * _UNITS)).astype(np.int64)


def _path(x: Floats, y: Floats, limits: Limits, *, dots: bool = False) -> str:
    """Moves relative to the point before; a row that is not finite begins a new piece."""
    good = np.isfinite(x) & np.isfinite(y)
    across = _units(np.where(good, x, 0.0), limits[0], limits[1])
    down = _UNITS - _units(np.where(good, y, 0.0), limits[2], limits[3])
    words: list[str] = []
    before: tuple[int, int] | None = None
    for keep, a, d in zip(good.tolist(), across.tolist(), down.tolist(), strict=True):
        if not keep:
            before = None
            continue
        if dots:
            words.append(f"M{a} {d}h0")
        elif before is None:
            words.append(f"M{a} {d}l0 0")
        else:
            words.append(f" {a - before[0]} {d - before[1]}")
        before = (a, d)
    return "".join(words)
