"""A diagnosis as figures: error stage by stage, residuals against all they may depend on, what is left."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import signal

from impid_host.diagnosis.result import Diagnosis, Structure, Trace
from impid_host.report.diagnosis_tables import stage_name
from impid_host.report.diagnosis_units import channel_unit, structure_words, variable_unit
from impid_host.report.style import STYLE
from impid_host.signals.arrays import Floats

# Okabe and Ito's palette: told apart in print and by colour-blind readers.
_BEFORE, _AFTER, _FLOOR = "#d55e00", "#0072b2", "#333333"
_BINS = 30
_RATE_HZ = 100.0
_HIGHEST_HZ = 6.0  # the residual is low-passed


def draw_diagnosis(diagnosis: Diagnosis, folder: Path) -> list[Path]:
    """Write the figures to a folder; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(STYLE):
        drawn = [_save(_stages(diagnosis), folder / "diagnosis_stages.png")]
        for key in dict.fromkeys(trace.channel for trace in diagnosis.traces):
            own = [trace for trace in diagnosis.traces if trace.channel == key]
            drawn.append(_save(_residuals(diagnosis, key, own), folder / f"diagnosis_residual_{key}.png"))
        for number, row in enumerate(diagnosis.structure):
            if len(row.curve):
                drawn.append(_save(_curve(diagnosis, row), folder / f"diagnosis_left_{number + 1}.png"))
    return drawn


def _stages(diagnosis: Diagnosis) -> Figure:
    keys = list(diagnosis.floor)
    figure, axes = plt.subplots(1, len(keys), figsize=(1.5 * len(keys) + 1, 3.2), squeeze=False)
    names = ["first model"] + [
        f"+ {stage.added.effect}" for stage in diagnosis.stages if stage.added is not None
    ]
    for axis, key in zip(axes[0], keys, strict=True):
        axis.bar(range(len(names)), [stage.rms[key] for stage in diagnosis.stages], color=_AFTER, width=0.6)
        if (level := diagnosis.floor[key]) is not None:
            axis.axhline(level, color=_FLOOR, linestyle="--", label="noise floor")
        axis.set_xticks(range(len(names)), names, rotation=60, ha="right")
        axis.set_title(f"{key} ({channel_unit(key, diagnosis.prismatic)})")
        axis.grid(visible=False, axis="x")
    axes[0][0].set_ylabel("rms on held-out data")
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside upper right")
    return figure


def _residuals(diagnosis: Diagnosis, key: str, traces: Sequence[Trace]) -> Figure:
    """Before and after, against time, frequency, and all of the motion."""
    unit = channel_unit(key, diagnosis.prismatic)
    variables = list(traces[0].motion)
    rows = 1 + -(-(1 + len(variables)) // 4)
    figure = plt.figure(figsize=(10.0, 2.3 * rows))
    grid = figure.add_gridspec(rows, 4)
    _against_time(figure.add_subplot(grid[0, :]), traces, unit)
    panels = [figure.add_subplot(grid[1 + k // 4, k % 4]) for k in range(1 + len(variables))]
    _against_frequency(panels[0], traces, unit)
    for panel, name in zip(panels[1:], variables, strict=True):
        values = np.concatenate([trace.motion[name] for trace in traces])
        before = np.concatenate([trace.before for trace in traces])
        after = np.concatenate([trace.after for trace in traces])
        for residual, color in ((before, _BEFORE), (after, _AFTER)):
            panel.plot(
                values[::7], residual[::7], ".", markersize=1.0, alpha=0.25, color=color, rasterized=True
            )
        for residual, color in ((before, _BEFORE), (after, _AFTER)):
            place, level = binned(values, residual)
            panel.plot(place, level, color="white", linewidth=2.6)
            panel.plot(place, level, color=color)
        panel.axhline(0.0, color=_FLOOR, linewidth=0.5)
        panel.set_xlabel(f"{name} ({variable_unit(name, key, diagnosis.prismatic)})")
    found = [stage_name(stage) for stage in diagnosis.stages[1:]]
    title = " ".join([f"Residual of {key} ({unit}): papers' model", *found])
    figure.suptitle(title, x=0.01, ha="left", fontsize=9)
    return figure


def _against_time(axis: Axes, traces: Sequence[Trace], unit: str) -> None:
    """One trial after the other; what was held out is shaded."""
    start = 0.0
    for number, trace in enumerate(traces):
        t = trace.t - trace.t[0] + start
        first = number == 0
        axis.plot(t, trace.before, color=_BEFORE, linewidth=0.6, label="papers' model" if first else None)
        axis.plot(t, trace.after, color=_AFTER, linewidth=0.6, label="last stage" if first else None)
        if trace.held_out.any():
            held = t[trace.held_out]
            axis.axvspan(held[0], held[-1], color="#dcdcdc", zorder=0, label="held out" if first else None)
        axis.text(t[0], 1.0, trace.trial, transform=axis.get_xaxis_transform(), va="bottom", fontsize=7)
        start = float(t[-1]) + 2.0
    axis.set_xlabel("time, trials one after the other (s)")
    axis.set_ylabel(unit)
    axis.legend(loc="upper right", ncols=3, frameon=True, framealpha=0.9, edgecolor="none")
    axis.margins(x=0.01)


def _against_frequency(axis: Axes, traces: Sequence[Trace], unit: str) -> None:
    for part, color in (("before", _BEFORE), ("after", _AFTER)):
        spectra = []
        for trace in traces:
            residual = getattr(trace, part)
            if len(residual) < 200:
                continue
            frequency, power = signal.welch(residual, _RATE_HZ, nperseg=min(len(residual), 1024))
            spectra.append((frequency, power))
        shortest = min((len(f) for f, _ in spectra), default=0)
        own = [power for frequency, power in spectra if len(frequency) == shortest]
        if own:
            frequency = next(f for f, _ in spectra if len(f) == shortest)
            shown = (frequency > 0) & (frequency < _HIGHEST_HZ)
            axis.semilogy(frequency[shown], np.sqrt(np.mean(own, axis=0))[shown], color=color)
    axis.set_xlim(0.0, _HIGHEST_HZ)
    axis.set_xlabel("frequency (Hz)")
    axis.set_ylabel(rf"{unit} / $\sqrt{{\mathrm{{Hz}}}}$")


def binned(values: Floats, residual: Floats) -> tuple[Floats, Floats]:
    """Mean residual in bins that hold equally many rows; few values make a bin each."""
    levels = np.unique(values)
    if len(levels) <= 3:
        return levels, np.array([residual[values == level].mean() for level in levels])
    order = np.array_split(np.argsort(values), _BINS)
    place = np.array([values[part].mean() for part in order])
    return place, np.array([residual[part].mean() for part in order])


def _curve(diagnosis: Diagnosis, row: Structure) -> Figure:
    figure, axis = plt.subplots(figsize=(4.5, 3))
    axis.fill_between(row.curve[:, 0], row.band[:, 0], row.band[:, 1], alpha=0.25, color=_AFTER, linewidth=0)
    axis.plot(row.curve[:, 0], row.curve[:, 1], color=_AFTER)
    axis.set_xlabel(f"{row.variable} ({variable_unit(row.variable, row.on, diagnosis.prismatic)})")
    axis.set_ylabel(f"left in {row.on}")
    axis.set_title("\n".join(_lines(structure_words(row, diagnosis), 60)), fontsize=8)
    return figure


def _lines(words: str, most: int) -> list[str]:
    lines = [""]
    for word in words.split():
        if len(lines[-1]) + len(word) > most:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


def _save(figure: Figure, path: Path) -> Path:
    figure.savefig(path)
    plt.close(figure)
    return path
