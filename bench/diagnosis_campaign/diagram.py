"""The reliability diagram: how many of the names given with a confidence were right, against the confidence."""

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
from matplotlib import pyplot as plt

Json = dict[str, Any]


def draw(reliability: Json, file: Path) -> None:
    """One point for each tenth of the confidence, with its 95 % interval; the diagonal is a calibrated confidence."""
    rows = [row for row in reliability.values() if row["of"]]
    mean, share = [row["mean"] for row in rows], [row["share"] for row in rows]
    below = [max(row["share"] - row["ci95"][0], 0.0) for row in rows]
    above = [max(row["ci95"][1] - row["share"], 0.0) for row in rows]
    figure, axes = plt.subplots(figsize=(4.6, 4.2), layout="constrained")
    axes.plot([0, 1], [0, 1], color="0.6", linewidth=1, linestyle="--")
    axes.errorbar(mean, share, yerr=[below, above], fmt="o", color="#0072B2", capsize=3)
    for x, row in zip(mean, rows, strict=True):
        text = f"{row['count']} of {row['of']}"
        axes.annotate(text, (x, row["ci95"][0]), xytext=(0, -14), textcoords="offset points", ha="center")
    axes.set(xlabel="confidence given with a name", ylabel="share of names that were right")
    axes.set(xlim=(0, 1.1), ylim=(0, 1.05))
    figure.savefig(file, dpi=150)
    plt.close(figure)
