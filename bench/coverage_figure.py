"""Coverage and efficiency of every parameter as one figure, from what bench/coverage.py counted."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

_PARTS = {"robot": "#333333", "method 1": "#0072b2", "method 2": "#d55e00"}
Counted = Mapping[str, Mapping[str, Mapping[str, float]]]


def draw(result: Counted, studies: int, path: Path) -> None:
    """Coverage above, squared error over the bound below; one column of dots per row of the page and part."""
    figure = Figure(figsize=(7.4, 4.8), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    for column, row in enumerate(result.values()):
        for shift, (part, color) in zip((-0.25, 0.0, 0.25), _PARTS.items(), strict=True):
            own = [entry for name, entry in row.items() if name.startswith(part)]
            place = column + shift + np.linspace(-0.08, 0.08, len(own))
            style = {
                "color": color,
                "marker": "o",
                "ms": 2.6,
                "ls": "",
                "label": part if column == 0 else None,
            }
            upper.plot(place, [entry["coverage_percent"] for entry in own], **style)
            lower.plot(place, [entry["mse_over_crb"] for entry in own], **style)
    error = 100 * np.sqrt(0.95 * 0.05 / studies)
    upper.axhspan(93, 97, color="#eeeeee", zorder=0)
    upper.axhspan(95 - 1.96 * error, 95 + 1.96 * error, color="#d9d9d9", zorder=0)
    upper.set(ylabel="intervals with truth (%)", ylim=(91, 99))
    lower.axhline(1.0, color="#999999", lw=0.8, zorder=0)
    lower.axhline(1.2, color="#999999", lw=0.8, ls=":", zorder=0)
    lower.set(ylabel="squared error / bound", ylim=(0.8, 1.3))
    lower.set_xticks(range(len(result)), [name.replace(", ", "\n") for name in result], fontsize=8)
    upper.legend(frameon=False, ncols=3, fontsize=8, loc="upper right")
    for axes in (upper, lower):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=180)
