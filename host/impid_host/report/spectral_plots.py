"""Figures of the spectral method: impedance, coherence, agreement and stiffness ellipses.

They show our data in the arrangement of [P] Figs. 5 to 10.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.agreement import Agreement
from impid_host.impedance.spectral.arrays import Complexes, Floats
from impid_host.impedance.spectral.distortion import DistortionLevels
from impid_host.impedance.spectral.estimate import SpectralEstimate
from impid_host.impedance.spectral.second_order import second_order_impedance
from impid_host.report.style import STYLE

Model = tuple[Floats, Floats, Floats]
# Okabe and Ito's palette: told apart in print and by colour-blind readers.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")
MARKERS = ("o", "s", "^", "D")
LINES = ("--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))
MODEL_COLOUR = "#999999"
WIDTH_IN = 7.0
AXES = "xy"


def impedance_figure(
    estimates: Mapping[str, Sequence[SpectralEstimate]], model: Model | None = None, title: str = ""
) -> Figure:
    """Gain and phase of each element of Z, mean over the trials, as [P] Figs. 6 and 9.

    Args:
        estimates: by label (one per Welch setting), the estimates of the trials.
        model: (M, B, K) drawn in grey: the expected or the fitted one.
        title: of the figure.

    Raises:
        UndeterminedError: a label without trials, or a load that has not two axes.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 7.2))
        panels = figure.subplots(4, 2, sharex=True)
        for k, (label, trials) in enumerate(estimates.items()):
            frequency, Z = _mean_impedance(label, trials)
            for i in range(2):
                for j in range(2):
                    gain, phase = panels[2 * i, j], panels[2 * i + 1, j]
                    style: dict[str, Any] = {"color": COLOURS[k], "linestyle": LINES[k], "label": label}
                    gain.plot(frequency, 20 * np.log10(np.abs(Z[:, i, j])), **style)
                    phase.plot(frequency, np.angle(Z[:, i, j], deg=True), **style)
        if model is not None:
            _draw_model(panels, model, frequency)
        for i in range(2):
            for j in range(2):
                panels[2 * i, j].set_title(f"$Z_{{{AXES[i]}{AXES[j]}}}$", loc="left")
            panels[2 * i, 0].set_ylabel("gain (dB re 1 N s/m)")
            panels[2 * i + 1, 0].set_ylabel("phase (deg)")
            for panel in panels[2 * i + 1]:
                panel.set_ylim(-190, 190)
                panel.set_yticks([-180, -90, 0, 90, 180])
        _finish(figure, panels, title)
    return figure


def coherence_figure(estimates: Mapping[str, Sequence[SpectralEstimate]], title: str = "") -> Figure:
    """Partial and multiple coherences, mean over the trials, as [P] Figs. 7 and 10. Arguments as above."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 5.6))
        panels = figure.subplots(3, 2, sharex=True, sharey=True)
        for k, (label, trials) in enumerate(estimates.items()):
            band = trials[0].band
            frequency = trials[0].frequency_Hz[band]
            partial = np.mean([t.best.partial_coherence[band] for t in trials], axis=0)
            multiple = np.mean([t.best.multiple_coherence[band] for t in trials], axis=0)
            chance = float(np.mean([t.zero_coherence_level for t in trials]))
            style: dict[str, Any] = {"color": COLOURS[k], "linestyle": LINES[k], "label": label}
            for i in range(2):
                for j in range(2):
                    panels[i, j].plot(frequency, partial[:, i, j], **style)
                    panels[i, j].axhline(chance, color=COLOURS[k], linewidth=0.5)
                panels[2, i].plot(frequency, multiple[:, i], **style)
        for i in range(2):
            for j in range(2):
                rest = AXES[1 - j]
                name = (
                    rf"$\gamma^2_{{F_{AXES[j]} {AXES[i]} \cdot F_{rest}}}$ partial, thin: 95 % of unrelated"
                )
                panels[i, j].set_title(name, loc="left")
            panels[2, i].set_title(rf"$\gamma^2_{{{AXES[i]},F}}$ multiple", loc="left")
        panels[0, 0].set_ylim(0, 1.02)
        _finish(figure, panels, title)
    return figure


def agreement_figure(
    results: Mapping[str, Mapping[str, Sequence[Sequence[Agreement]]]], title: str = ""
) -> Figure:
    """VAF of each element and R^2 per spring array, one mark per trial, as [P] Fig. 8.

    Args:
        results: by label (one per Welch setting), by configuration name, the agreements of each trial: a
            sequence per trial with one `Agreement` per band.
        title: of the figure.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 6.4))
        panels = figure.subplots(3, 2, sharex=True)
        names = list(next(iter(results.values())))
        series = 0
        for label, by_name in results.items():
            for band in range(len(next(iter(by_name.values()))[0])):
                upper = next(iter(by_name.values()))[0][band].upper_Hz
                name = f"{label}, 0 to {upper:g} Hz"
                _draw_agreement(panels, by_name, band, series, name)
                series += 1
        for i in range(2):
            for j in range(2):
                panels[i, j].set_title(f"VAF$_{{{AXES[i]}{AXES[j]}}}$ (%)", loc="left")
                panels[i, j].ticklabel_format(axis="y", useOffset=False)
        panels[2, 0].set_title("R²", loc="left")
        panels[2, 1].set_axis_off()
        panels[2, 1].legend(*panels[2, 0].get_legend_handles_labels(), loc="center left")
        # The upper right column has no panel below it to carry the names.
        for panel in (panels[2, 0], panels[1, 1]):
            panel.set_xticks(range(len(names)), names)
            panel.tick_params(labelbottom=True)
        figure.suptitle(title)
    return figure


def ellipse_figure(stiffness: Mapping[str, Floats], title: str = "") -> Figure:
    """Force of a unit displacement turned once around, K (cos, sin), per configuration, as [P] Fig. 5.

    Args:
        stiffness: by name, K (N/m), shape (2, 2).
        title: of the figure.
    """
    turn = np.linspace(0, 2 * np.pi, 181)
    unit = np.stack([np.cos(turn), np.sin(turn)])
    with mpl.rc_context(STYLE):
        columns = min(3, len(stiffness))
        rows = -(-len(stiffness) // columns)
        figure = Figure(figsize=(WIDTH_IN, 2.3 * rows))
        panels = np.atleast_1d(figure.subplots(rows, columns, sharex=True, sharey=True)).ravel()
        for panel, (name, K) in zip(panels, stiffness.items(), strict=False):
            force = K @ unit
            panel.plot(force[0], force[1], color=COLOURS[0])
            panel.set_title(name, loc="left")
            panel.set_aspect("equal")
        for panel in panels[len(stiffness) :]:
            panel.set_axis_off()
        figure.supxlabel("x (N/m)")
        figure.supylabel("y (N/m)")
        figure.suptitle(title)
    return figure


def detection_figure(
    results: Mapping[str, Sequence[DistortionLevels]], period_s: float, axis: int = 0, title: str = ""
) -> Figure:
    """Displacement at the excited lines of a multisine, and what the force does not explain at the others.

    Args:
        results: by label, the levels of each axis.
        period_s: of the multisine.
        axis: which one to draw.
        title: of the figure.
    """
    kinds = (("excited", 0, 3), ("odd, not excited", 1, 1), ("even", 2, 2))
    with mpl.rc_context(STYLE):
        columns = min(2, len(results))
        rows = -(-len(results) // columns)
        figure = Figure(figsize=(WIDTH_IN, 2.3 * rows + 0.7))
        panels = np.atleast_1d(figure.subplots(rows, columns, sharex=True, sharey=True)).ravel()
        for panel, (label, by_axis) in zip(panels, results.items(), strict=False):
            level = by_axis[axis]
            frequency = level.line / period_s
            for name, kind, colour in kinds:
                own = level.kind == kind
                panel.semilogy(
                    frequency[own],
                    1e3 * level.amplitude[own],
                    linestyle="none",
                    marker=MARKERS[kind],
                    markersize=2.5,
                    color=COLOURS[colour] if kind else MODEL_COLOUR,
                    label=name,
                )
            panel.semilogy(frequency, 1e3 * level.line_noise, color="#000000", linewidth=0.7, label="noise")
            panel.set_title(label, loc="left")
        for panel in panels[len(results) :]:
            panel.set_axis_off()
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
        for panel in panels[-columns:]:
            panel.set_xlabel("frequency (Hz)")
        figure.supylabel(f"{AXES[axis]} (mm per line)")
        figure.suptitle(title)
    return figure


def input_coherence_figure(
    results: Mapping[str, tuple[Floats, Floats]], levels: Mapping[str, float], title: str = ""
) -> Figure:
    """Ordinary coherence between the two interaction forces for several perturbations, one panel each.

    Args:
        results: by label, frequency (Hz) and coherence, shape (n_f,) each.
        levels: by label, its mean, written into the panel.
        title: of the figure.
    """
    with mpl.rc_context(STYLE):
        columns = min(2, len(results))
        rows = -(-len(results) // columns)
        figure = Figure(figsize=(WIDTH_IN, 1.9 * rows))
        panels = np.atleast_1d(figure.subplots(rows, columns, sharex=True, sharey=True)).ravel()
        for panel, (label, (frequency, coherence)) in zip(panels, results.items(), strict=False):
            panel.plot(frequency, coherence, color=COLOURS[0])
            panel.set_title(f"{label}: mean {levels[label]:.2f}", loc="left")
            panel.set_ylim(0, 1.02)
        for panel in panels[len(results) :]:
            panel.set_axis_off()
        figure.supxlabel("frequency (Hz)")
        figure.supylabel(r"$\gamma^2$ between $F_x$ and $F_y$")
        figure.suptitle(title)
    return figure


def _mean_impedance(label: str, trials: Sequence[SpectralEstimate]) -> tuple[Floats, Complexes]:
    if not trials:
        raise UndeterminedError(f"no trials to draw for {label!r}")
    Z = np.mean([t.best.Z for t in trials], axis=0)
    if Z.shape[1:] != (2, 2):
        raise UndeterminedError(f"the figure is for two axes, the load has {Z.shape[1]}")
    return trials[0].frequency_Hz[trials[0].band], Z


def _draw_model(panels: Any, model: Model, frequency: Floats) -> None:
    """The model behind the estimates; an element that vanishes has no gain to draw."""
    Z = second_order_impedance(frequency, *model)
    largest = np.max(np.abs(Z))
    for i in range(2):
        for j in range(2):
            if np.max(np.abs(Z[:, i, j])) > 1e-9 * largest:
                style: dict[str, Any] = {
                    "color": MODEL_COLOUR,
                    "linewidth": 2.2,
                    "zorder": 1,
                    "label": "model",
                }
                panels[2 * i, j].plot(frequency, 20 * np.log10(np.abs(Z[:, i, j])), **style)
                panels[2 * i + 1, j].plot(frequency, np.angle(Z[:, i, j], deg=True), **style)


def _draw_agreement(
    panels: Any, by_name: Mapping[str, Sequence[Sequence[Agreement]]], band: int, series: int, label: str
) -> None:
    """One series: marks of all trials of all configurations, set a little apart from the other series."""
    shift = 0.16 * (series - 1.5)
    style: dict[str, Any] = {
        "linestyle": "none",
        "marker": MARKERS[series % len(MARKERS)],
        "markersize": 3,
        "color": COLOURS[series % len(COLOURS)],
        "markerfacecolor": "none",
    }
    for k, trials in enumerate(by_name.values()):
        at = np.full(len(trials), k + shift)
        vaf = np.array([trial[band].vaf_percent for trial in trials])
        for i in range(2):
            for j in range(2):
                panels[i, j].plot(at, vaf[:, i, j], **style)
        legend = {"label": label} if k == 0 else {}
        panels[2, 0].plot(at, [trial[band].r_squared for trial in trials], **style, **legend)


def _finish(figure: Figure, panels: Any, title: str) -> None:
    for panel in panels[-1]:
        panel.set_xlabel("frequency (Hz)")
    first: Axes = panels[0, 0]
    figure.legend(*first.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    figure.suptitle(title)
