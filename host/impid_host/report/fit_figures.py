"""Figures of a fitted study: torque and force against their models, residuals, parameters with intervals."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from impid_host.checks.pushes import Pushes
from impid_host.impedance.campaign import StudyFit
from impid_host.impedance.identify import LoadFit, RobotFit
from impid_host.impedance.rows import Series
from impid_host.impedance.stochastic import SpectralFit
from impid_host.report.ellipses import ellipse_figure
from impid_host.report.fit_tables import judged_on
from impid_host.report.page.journal import draw_on
from impid_host.report.page.plot import Plot
from impid_host.report.page.residual_plots import load_residual_plots, robot_residual_plots
from impid_host.report.parameter_entries import parameter_entries
from impid_host.report.spectral_plots import coherence_figure, detection_figure, impedance_figure
from impid_host.report.style import STYLE

# Okabe and Ito's palette: told apart in print and by colour-blind readers.
_DATA, _FIT, _RESIDUAL, _SECOND = "#333333", "#0072b2", "#d55e00", "#009e73"
_WIDTH_IN = 7.0
_DETAIL_S = 10.0


def draw_study(result: StudyFit, folder: Path, pushes: Pushes) -> list[Path]:
    """Draw all figures of a study as PNG into `folder` and return their paths.

    Args:
        pushes: stretches to mark in the residuals of whole trials.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    with mpl.rc_context(STYLE):
        if isinstance(result.robot, RobotFit):
            paths.append(_save(robot_figure(result.robot), folder / "robot.png"))
            left = robot_residual_plots(result, pushes)
            paths.append(_save(residual_figure(left), folder / "residual_robot.png"))
        for load in dict.fromkeys(fit.load for fit in result.loads):
            fits = [fit for fit in result.loads if fit.load == load]
            paths.append(_save(load_figure(fits), folder / f"load_{load}.png"))
            left = load_residual_plots(fits[0], pushes)
            paths.append(_save(residual_figure(left), folder / f"residual_{load}.png"))
            paths.append(_save(parameter_figure(fits), folder / f"parameters_{load}.png"))
            if len(fits[0].model.axes) == 2:
                figure = ellipse_figure(fits, result.handle_mass_kg)
                paths.append(_save(figure, folder / f"ellipses_{load}.png"))
            if len(fits) > 1:
                paths.append(_save(force_figure(*fits[:2]), folder / f"force_{load}.png"))
    for fit in result.spectral:
        for name, figure in shaken_figures(fit).items():
            paths.append(_save(figure, folder / f"{name}_{fit.load}_{fit.method.split()[0]}.png"))
    return paths


def shaken_figures(fit: SpectralFit) -> dict[str, Figure]:
    """Impedance and coherences of one stochastic load, and what a periodic perturbation shows, by name."""
    best = fit.estimate.best.weighted_fit
    title = f"{fit.load}, {fit.method}, {len(fit.trials)} trial(s)"
    estimates = {fit.setting: [fit.estimate]}
    figures = {
        "impedance": impedance_figure(estimates, (best.M, best.B, best.K), f"{title}; model: weighted fit"),
        "coherence": coherence_figure(estimates, title),
    }
    if fit.periodic is not None:
        for axis, label in enumerate("xy"):
            figures[f"distortion_{label}"] = detection_figure(
                {f"along {label}": fit.periodic.distortion}, fit.periodic.period_s, axis, title
            )
    return figures


def residual_figure(plots: Sequence[Plot]) -> Figure:
    """What the model leaves of whole trials, a strip for each trial and channel; one scale per unit."""
    figure = Figure(figsize=(_WIDTH_IN, 1.15 * len(plots) + 0.5))
    strips = figure.subplots(len(plots), 1, squeeze=False)[:, 0]
    largest: dict[str, float] = {}
    for plot in plots:
        low, high = plot.limits()[2:]
        largest[plot.y_label] = max(largest.get(plot.y_label, 0.0), -low, high)
    legend: dict[str, Artist] = {}
    for strip, plot in zip(strips, plots, strict=True):
        draw_on(strip, plot)
        strip.set(xlabel="", ylim=(-largest[plot.y_label], largest[plot.y_label]))
        strip.title.set_fontsize(7.5)
        handles, labels = strip.get_legend_handles_labels()
        legend |= dict(zip(labels, handles, strict=True))
    strips[-1].set_xlabel(plots[-1].x_label)
    figure.legend(list(legend.values()), list(legend), loc="outside lower center", ncols=len(legend))
    figure.align_ylabels()
    return figure


def robot_figure(fit: RobotFit) -> Figure:
    """Torque of each joint, logged and by the model, over the held-out end of the first free trial."""
    part = fit.series[0]
    structure = fit.parameters.structure
    units = [structure.torque_units[joint].replace("*", " ") for joint in fit.joints]
    names = [
        ("force" if structure.model.prismatic[joint] else "torque")
        + (f" {joint + 1}" if structure.model.joints > 1 else "")
        for joint in fit.joints
    ]
    labels = [f"{name} ({unit})" for name, unit in zip(names, units, strict=True)]
    notes = [
        f"VAF {vaf:.2f} %, residual {_three(rms)} {unit} rms"
        for vaf, rms, unit in zip(fit.vaf, fit.rms, units, strict=True)
    ]
    return _against(
        part, labels, notes, f"Robot model on {judged_on(fit)}, {part.trial}", ("logged", "model")
    )


def load_figure(fits: Sequence[LoadFit]) -> Figure:
    """Force of the load, by the virtual sensor and by the load's model, with the residual below."""
    fit = fits[0]
    part = _negative(fit.series[0])
    unit = fit.model.force_unit.replace("*", " ")
    notes = [
        f"VAF {vaf:.2f} %, residual {_three(rms)} {unit} rms"
        for vaf, rms in zip(fit.vaf, fit.rms, strict=True)
    ]
    title = f"Load {fit.load} on {judged_on(fit)}, {part.trial}"
    labels = ["torque (N m)"] if fit.model.rotary else [f"$F_{axis}$ (N)" for axis in fit.model.axes]
    source = "measured torque" if fit.model.rotary else fit.method
    return _against(part, labels, notes, title, (source, "load model"))


def force_figure(virtual: LoadFit, physical: LoadFit) -> Figure:
    """The virtual sensor against the physical one: over time, and against each other."""
    names = {part.trial for part in virtual.series}
    measured = _negative(next(part for part in physical.series if part.trial in names))
    estimated = _negative(next(part for part in virtual.series if part.trial == measured.trial))
    rows = _detail(measured)
    figure = Figure(figsize=(_WIDTH_IN, 4.6))
    axes = figure.subplots(2, 2, width_ratios=(2.4, 1), squeeze=False)
    for axis, name in enumerate("xy"):
        left, right = axes[axis]
        left.plot(measured.t[rows], measured.target[rows, axis], color=_DATA, label="physical sensor")
        left.plot(
            measured.t[rows],
            estimated.target[rows, axis],
            color=_FIT,
            ls=(0, (4, 1.5)),
            label="virtual sensor",
        )
        left.set_ylabel(f"$F_{name}$ (N)")
        shown = measured.shown & estimated.shown
        known, guessed = measured.target[shown, axis], estimated.target[shown, axis]
        error = guessed - known
        right.plot(known, guessed, ".", color=_FIT, ms=1.5, alpha=0.4, rasterized=True)
        span = [float(known.min()), float(known.max())]
        right.plot(span, span, color=_DATA, lw=0.7)
        right.set(xlabel=f"physical $F_{name}$ (N)", ylabel=f"virtual $F_{name}$ (N)")
        relative = 100 * np.linalg.norm(error) / np.linalg.norm(known)
        right.set_title(f"rms {_three(float(np.sqrt(np.mean(error**2))))} N ({relative:.2f} %)")
    figure.suptitle(f"Force of the load on the robot, {measured.trial}", x=0.01, ha="left", fontsize=9)
    for left in axes[:, 0]:
        left.margins(x=0)
    axes[1, 0].set_xlabel("time (s)")
    _legend_above(axes[0, 0])
    return figure


def parameter_figure(fits: Sequence[LoadFit]) -> Figure:
    """Every parameter on its own scale with its 95 % interval, the methods side by side."""
    entries = parameter_entries(fits[0])
    columns = min(len(entries), 7)
    rows = -(-len(entries) // columns)
    figure = Figure(figsize=(_WIDTH_IN, 1.9 * rows + 0.3))
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel, entry in zip(axes, entries, strict=False):
        for index, (fit, color) in enumerate(zip(fits, (_FIT, _SECOND), strict=False)):
            value, ci = entry.of(fit)
            error = [[value - ci[0]], [ci[1] - value]]
            panel.errorbar(
                [index], [value], yerr=error, fmt="o", ms=4, capsize=4, lw=1.2, color=color, label=fit.method
            )
        panel.set_title(f"{entry.label}\n({entry.unit.replace('*', ' ')})", loc="center")
        panel.set_xlim(-0.7, len(fits) - 0.3)
        panel.set_xticks([])
        panel.ticklabel_format(useOffset=False)
        panel.tick_params(labelsize=6.5)
        panel.locator_params(axis="y", nbins=4)
        panel.margins(y=0.25)
    for panel in axes[len(entries) :]:
        panel.set_axis_off()
    figure.suptitle(f"Load {fits[0].load}: estimates with 95 % intervals", x=0.01, ha="left", fontsize=9)
    if len(fits) > 1:
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure


def _against(
    part: Series, labels: Sequence[str], notes: Sequence[str], title: str, names: tuple[str, str]
) -> Figure:
    rows = _detail(part)
    count = len(labels)
    figure = Figure(figsize=(_WIDTH_IN, 2.5 * count + 0.2))
    axes = figure.subplots(2 * count, 1, sharex=True, height_ratios=[2.2, 1] * count, squeeze=False)[:, 0]
    for channel, (label, note) in enumerate(zip(labels, notes, strict=True)):
        top, bottom = axes[2 * channel], axes[2 * channel + 1]
        target, fit = part.target[rows, channel], part.fit[rows, channel]
        top.plot(part.t[rows], target, color=_DATA, lw=1.6, label=names[0])
        top.plot(part.t[rows], fit, color=_FIT, ls=(0, (4, 1.5)), label=names[1])
        top.set_ylabel(label)
        bottom.plot(part.t[rows], target - fit, color=_RESIDUAL, lw=0.9)
        bottom.axhline(0, color="#999999", lw=0.6)
        bottom.set_ylabel("residual")
        bottom.text(0.995, 0.94, note, transform=bottom.transAxes, ha="right", va="top", fontsize=7)
        bottom.margins(y=0.35)
        bottom.set_xlim(part.t[rows][0], part.t[rows][-1])
    axes[0].set_title(title)
    axes[-1].set_xlabel("time (s)")
    _legend_above(axes[0])
    figure.align_ylabels()
    return figure


def _legend_above(axes: Axes) -> None:
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)


def _detail(part: Series) -> NDArray[np.intp]:
    """Rows of the held-out end, at most 10 s of it."""
    rows = np.flatnonzero(part.held_out)
    result: NDArray[np.intp] = rows[part.t[rows] >= part.t[rows[-1]] - _DETAIL_S]
    return result


def _negative(part: Series) -> Series:
    """The regression's target is -F_ext; figures show F_ext."""
    return Series(part.trial, part.t, -part.target, -part.fit, part.held_out, part.shown)


def _three(value: float) -> str:
    return f"{value:.3g}"


def _save(figure: Figure, path: Path) -> Path:
    figure.savefig(path)
    return path
