"""Stiffness, damping and inertia ellipses, in space ellipsoids.

They show the force that a unit displacement, velocity or acceleration in each direction meets (Mussa-Ivaldi,
Hogan and Bizzi 1985).
"""

from collections.abc import Sequence
from itertools import combinations

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


def shadow(matrix: Floats, plane: tuple[int, int], count: int = 181) -> Floats:
    """Outline on a plane of the image of the unit ball under the matrix's symmetric part, (count, 2)."""
    rows = 0.5 * (matrix + matrix.T)[list(plane)]
    power, ways = np.linalg.eigh(rows @ rows.T)
    return ellipse((ways * np.sqrt(np.maximum(power, 0.0))) @ ways.T, count)


def ellipse_figure(fits: Sequence[LoadFit], handle_mass_kg: float = 0.0) -> Figure:
    """One column for each matrix of the model; faint lines are draws from the estimate's distribution.

    In space there are three rows: an ellipsoid's shadows on the planes of the base frame.
    """
    names = fits[0].model.axes
    d = len(names)
    planes = list(combinations(range(d), 2))
    panels = [panel for panel in PANELS if fits[0].model.has(panel[1])]
    figure = Figure(figsize=(2.35 * len(panels), 0.5 + 2.4 * len(planes)))
    for (i, j), line in zip(planes, figure.subplots(len(planes), len(panels), squeeze=False), strict=True):
        for panel, (title, signal, unit) in zip(line, panels, strict=True):
            for fit, color, dashes in zip(fits, _COLORS, ("-", (0, (4, 3))), strict=False):
                own = handle_mass_kg * np.eye(d) if signal == "a" and fit.model.carries_handle else 0.0
                S = fit.model.matrix_map(signal)
                for draw in draws(fit):
                    faint = shadow((S @ draw).reshape(d, d) - own, (i, j))
                    panel.plot(*faint.T, color=color, lw=0.4, alpha=0.12)
                best = shadow((S @ fit.estimate.value).reshape(d, d) - own, (i, j))
                panel.plot(*best.T, color=color, ls=dashes, lw=1.4, label=fit.method)
            panel.set_aspect("equal", adjustable="datalim")
            panel.set(title=f"{title} ({unit})", xlabel=f"along {names[i]}")
            panel.axhline(0, color="#999999", lw=0.6)
            panel.axvline(0, color="#999999", lw=0.6)
        line[0].set_ylabel(f"along {names[j]}")
    figure.suptitle(f"Load {fits[0].load}", x=0.01, ha="left", fontsize=9)
    handles, labels = panel.get_legend_handles_labels()
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
