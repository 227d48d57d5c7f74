"""The page's figures for print: PDF and SVG, as wide as one or two columns of a journal."""

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from impid_host.report.page.plot import COLOURS, DASHES, Plot
from impid_host.report.style import STYLE

# 88 mm and 180 mm, the columns of IEEE and Elsevier.
ONE_COLUMN_IN, TWO_COLUMNS_IN = 3.46, 7.09
# Text stays text in both formats, so that a journal can set it anew.
_PRINT = {**STYLE, "font.size": 7.5, "pdf.fonttype": 42, "svg.fonttype": "none", "svg.hashsalt": "impid"}


def draw(plots: list[Plot], folder: Path) -> list[Path]:
    """Write every plot to `folder` as PDF and as SVG; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths: list[Path] = []
    with mpl.rc_context(_PRINT):
        for plot in plots:
            figure = _figure(plot)
            for ending in ("pdf", "svg"):
                path = folder / f"{plot.file_name}.{ending}"
                # Without the date the same study gives the same file.
                figure.savefig(path, metadata={"CreationDate": None} if ending == "pdf" else {"Date": None})
                paths.append(path)
    return paths


def _figure(plot: Plot) -> Figure:
    size = (ONE_COLUMN_IN, ONE_COLUMN_IN) if plot.square else (TWO_COLUMNS_IN, 2.3)
    figure = Figure(figsize=size)
    axes = figure.subplots()
    draw_on(axes, plot)
    handles, labels = axes.get_legend_handles_labels()
    own = dict(zip(labels, handles, strict=True))
    if own:
        figure.legend(own.values(), own.keys(), loc="outside lower center", ncols=min(len(own), 4))
    return figure


def draw_on(axes: Axes, plot: Plot) -> None:
    """One plot into the axes of a figure; the legend is the caller's."""
    for span in plot.spans:
        hatch = "////" if span.kind == "event" else None
        axes.axvspan(
            span.low, span.high, facecolor="#e3e3e3", edgecolor="#777777", hatch=hatch, lw=0, zorder=0,
            label=span.kind,
        )  # fmt: skip
    for band in plot.bands:
        axes.fill_between(band.x, band.low, band.high, color=COLOURS[band.role], alpha=0.18, lw=0)
    for line in plot.drawn:
        dashes = DASHES[line.role]
        style = "-" if not dashes or line.faint else (0, dashes)
        if line.dots:
            axes.plot(line.x, line.y, ".", ms=3, color=COLOURS[line.role], label=line.name or None)
        else:
            axes.plot(
                line.x, line.y, ls=style, color=COLOURS[line.role], label=line.name or None,
                lw=0.3 if line.faint else 0.9, alpha=0.3 if line.faint else 1.0,
            )  # fmt: skip
    axes.set(xlabel=plot.x_label, ylabel=plot.y_label, title=plot.title)
    if plot.square:
        axes.set_aspect("equal", adjustable="datalim")
    else:
        axes.margins(x=0)
    if plot.y_range is not None:
        axes.set_ylim(plot.y_range)
