"""Figs. 3 and 5 of the first paper from our code."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from campaign import Result
from impid_host.signals.chain import DEFAULT, PUBLISHED
from matplotlib.figure import Figure

_RATE_HZ = 1000.0
_METHODS = {"method1": ("Method 1", "#0072b2", "o"), "method2": ("Method 2", "#d55e00", "D")}


def draw_filters(path: Path) -> None:
    """Fig. 3: magnitude of the smoothing and the differentiation filter, by what they do to an impulse."""
    count = 16_384
    impulse = np.zeros(count)
    impulse[count // 2] = 1.0
    frequency = np.fft.rfftfreq(count, 1 / _RATE_HZ)
    smooth = np.abs(np.fft.rfft(PUBLISHED.value(impulse, _RATE_HZ)))
    slope = np.abs(np.fft.rfft(PUBLISHED.derivative(impulse, _RATE_HZ)))
    assert DEFAULT.finish is not None
    ours = np.abs(np.fft.rfft(DEFAULT.finish.apply(DEFAULT.value(impulse, _RATE_HZ), _RATE_HZ)))
    figure = Figure(figsize=(6.5, 2.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.plot(frequency, smooth, color="#0072b2", label="published")
    left.plot(frequency, ours, color="#d55e00", ls="--", label="default chain")
    left.set(title="Smoothing filter", xlabel="frequency (Hz)", ylabel="gain", xlim=(0, 10), ylim=(0, 1.1))
    left.legend(frameon=False)
    right.plot(frequency, slope, color="#0072b2", label="published")
    right.plot(frequency, 2 * np.pi * frequency, color="#333333", ls=":", lw=0.9, label="ideal")
    right.set(title="Differentiation filter", xlabel="frequency (Hz)", ylabel="gain (1/s)")
    right.set(xlim=(0, 10), ylim=(0, 25))
    right.legend(frameon=False)
    for axes in (left, right):
        axes.axvspan(0, 2, color="#eeeeee", zorder=0)
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=180)


def draw_campaign(results: Mapping[str, Result], published: dict[str, Any], path: Path) -> None:
    """Fig. 5: identified against true parameters, the paper's points and ours, by both methods."""
    theory, identified = published["theory"], published["identified"]
    figure = Figure(figsize=(7.2, 6.4), layout="constrained")
    panels = figure.subplots(2, 2).ravel()
    names = (
        ("m", "mxx", "m (kg)"),
        ("kxx", "kxx", "kxx (N/m)"),
        ("kyy", "kyy", "kyy (N/m)"),
        ("ks", "kxy", "ks (N/m)"),
    )
    for panel, (name, key, label) in zip(panels, names, strict=True):
        for method, (words, color, marker) in _METHODS.items():
            paper = _paper_points(theory, identified[method], name)
            panel.errorbar(
                paper[0],
                paper[1],
                yerr=paper[2],
                fmt=marker,
                ms=6,
                mfc="none",
                color=color,
                lw=0.8,
                label=f"{words}, paper",
            )
            own = [row for row in results["default"].rows if row.method == method]
            truth = [_truth(theory, row.load, name) for row in own]
            panel.plot(
                truth,
                [row.values[key] for row in own],
                marker,
                ms=2.5,
                color=color,
                label=f"{words}, ours",
                ls="",
            )
        span = np.array(panel.get_xlim())
        panel.plot(span, span, ":", color="#555555", lw=0.9)
        panel.set(title=label, xlabel="true", ylabel="identified")
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=180)


def _truth(theory: dict[str, Any], load: str, name: str) -> float:
    _, stiffness, mass = load.split("_")
    return float(theory["m_kg"][mass] if name == "m" else theory["K"][stiffness][name])


def _paper_points(theory: dict[str, Any], identified: dict[str, Any], name: str) -> np.ndarray:
    if name == "m":
        rows = [(theory["m_kg"][k], *identified["m_kg"][k]) for k in theory["m_kg"]]
    else:
        rows = [(theory["K"][k][name], *identified[k][name]) for k in theory["K"] if identified[k][name]]
    return np.array(rows).T
