"""Impedance as curves, drawn: K, B and x0 with their bands, the constant fit beside them."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from impid_host.impedance.identify import LoadFit
from impid_host.impedance.varying.fit import VaryingFit
from impid_host.report.style import STYLE
from impid_host.report.varying_report import group_of, shown_in

_CURVE, _CONSTANT = "#0072b2", "#d55e00"


def draw_varying(fits: Sequence[VaryingFit], constant: Sequence[LoadFit], folder: Path) -> list[Path]:
    """One figure for each fit; the constant fit's values as a dashed line."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for fit in fits:
        same = [own for own in constant if (own.load, own.method) == (fit.load, fit.method)]
        with mpl.rc_context(STYLE):
            figure = varying_figure(fit, same[0] if same else None)
            name = fit.trials[0] if fit.by == "time" else fit.load
            path = folder / f"varying_{name}_{fit.method.split()[0]}.png"
            figure.savefig(path)
        paths.append(path)
    return paths


def varying_figure(fit: VaryingFit, constant: LoadFit | None = None) -> Figure:
    """K, B and x0 in a row each, their bands shaded."""
    rows = [[n for n in fit.curves if group_of(n) == group] for group in ("K", "B", "x0")]
    rows = [row for row in rows if row]
    width = max(len(row) for row in rows)
    figure = Figure(figsize=(max(4.5, 2.2 * width), 1.7 * len(rows) + 0.4))
    panels = figure.subplots(len(rows), width, sharex=True, squeeze=False)
    flat = _flat(constant)
    for line, row in zip(panels, rows, strict=True):
        for panel, name in zip(line, row, strict=False):
            own = fit.curves[name]
            scale, unit = shown_in(own.unit)
            panel.fill_between(fit.places, scale * own.low, scale * own.high, color=_CURVE, alpha=0.22, lw=0)
            panel.plot(fit.places, scale * own.value, color=_CURVE, label="curve, band of 95 %")
            if name in flat:
                panel.axhline(scale * flat[name], color=_CONSTANT, ls="--", lw=0.9, label="as a constant")
            panel.ticklabel_format(useOffset=False)
            one = next(a for a in fit.asked if a.group == group_of(name))
            word = "changes" if one.group in fit.claimed else "constant will do"
            panel.set_title(f"{name}: {word}" if name == row[0] else name)
            panel.set_ylabel(unit.replace("*", " "))
        for panel in line[len(row) :]:
            panel.set_axis_off()
    for panel in panels[-1]:
        panel.set_xlabel(f"{fit.by} ({fit.unit})" if fit.unit else fit.by)
    figure.legend(*panels[0][0].get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return figure


def _flat(constant: LoadFit | None) -> dict[str, float]:
    if constant is None:
        return {}
    own = dict(zip(constant.estimate.names, constant.estimate.value.tolist(), strict=True))
    places = {f"{axis}0": float(v) for axis, v in zip(constant.model.axes, constant.x0.value, strict=True)}
    return own | places
