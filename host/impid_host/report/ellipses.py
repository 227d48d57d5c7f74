"""Stiffness, damping and inertia ellipses: the force that a unit displacement, velocity or acceleration
in each direction meets (Mussa-Ivaldi, Hogan and Bizzi 1985).
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from impid_host.impedance.identify import LoadFit
from impid_host.impedance.loads import Signal
from impid_host.signals.arrays import Floats

PANELS: tuple[tuple[str, Signal, str], ...] = (
    ("Stiffness", "x", "N/m"),
    ("Damping", "v", "N s/m"),
    ("Inertia", "a", "kg"),
)
_COLORS = ("#0072b2", "#d55e00")
_DRAWS = 60


def ellipse(matrix: Floats, count: int = 181) -> Floats:
    """The image of the unit circle under the matrix's symmetric part, (count, 2)."""
    angle = np.linspace(0, 2 * np.pi, count)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    result: Floats = circle @ (0.5 * (matrix + matrix.T))
    return result


def ellipse_figure(fits: Sequence[LoadFit], handle_mass_kg: float = 0.0) -> Figure:
    """One panel for each matrix of the model; faint lines are draws from the estimate's distribution."""
    panels = [panel for panel in PANELS if fits[0].model.has(panel[1])]
    figure = Figure(figsize=(2.35 * len(panels), 2.9))
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    for panel, (title, signal, unit) in zip(axes, panels, strict=True):
        for fit, color, dashes in zip(fits, _COLORS, ("-", (0, (4, 3))), strict=False):
            own = handle_mass_kg * np.eye(2) if signal == "a" and fit.model.carries_handle else 0.0
            S = fit.model.matrix_map(signal)
            for draw in draws(fit):
                panel.plot(*ellipse((S @ draw).reshape(2, 2) - own).T, color=color, lw=0.4, alpha=0.12)
            best = (S @ fit.estimate.value).reshape(2, 2) - own
            panel.plot(*ellipse(best).T, color=color, ls=dashes, lw=1.4, label=fit.method)
        panel.set_aspect("equal", adjustable="datalim")
        panel.set(title=f"{title} ({unit})", xlabel="along x")
        panel.axhline(0, color="#999999", lw=0.6)
        panel.axvline(0, color="#999999", lw=0.6)
    axes[0].set_ylabel("along y")
    figure.suptitle(f"Load {fits[0].load}", x=0.01, ha="left", fontsize=9)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure


def draws(fit: LoadFit) -> Floats:
    """Parameters drawn from the estimate's t distribution, the same every time, (_DRAWS, q)."""
    estimate = fit.estimate
    rng = np.random.default_rng(0)
    normal = rng.multivariate_normal(np.zeros(len(estimate.value)), estimate.covariance, _DRAWS)
    spread = np.sqrt(estimate.dof / rng.chisquare(estimate.dof, _DRAWS))
    result: Floats = estimate.value + normal * spread[:, None]
    return result
