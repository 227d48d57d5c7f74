"""A diagnosis as figures: error stage by stage against the noise floor, and what is left as curves."""

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from impid_host.diagnosis.result import Diagnosis, Structure


def draw_diagnosis(diagnosis: Diagnosis, folder: Path) -> list[Path]:
    """Write the figures to a folder; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = [_stages(diagnosis, folder / "diagnosis_stages.png")]
    for number, row in enumerate(diagnosis.structure):
        if len(row.curve):
            drawn.append(_curve(row, folder / f"diagnosis_left_{number + 1}.png"))
    return drawn


def _stages(diagnosis: Diagnosis, path: Path) -> Path:
    keys = list(diagnosis.floor)
    figure, axes = plt.subplots(1, len(keys), figsize=(2.2 * len(keys) + 1, 3.4), squeeze=False)
    names = ["papers' model"] + [
        f"+ {stage.added.effect}" for stage in diagnosis.stages if stage.added is not None
    ]
    for axis, key in zip(axes[0], keys, strict=True):
        axis.bar(range(len(names)), [stage.rms[key] for stage in diagnosis.stages], color="tab:blue")
        axis.axhline(diagnosis.floor[key], color="black", linestyle="--", linewidth=1, label="noise floor")
        axis.set_xticks(range(len(names)), names, rotation=60, ha="right", fontsize=7)
        axis.set_title(f"{key} ({'N m' if key.startswith('tau') else 'N'})", fontsize=9)
        axis.tick_params(axis="y", labelsize=7)
    axes[0][0].set_ylabel("rms on held-out data")
    axes[0][0].legend(fontsize=7)
    return _save(figure, path)


def _curve(row: Structure, path: Path) -> Path:
    figure, axis = plt.subplots(figsize=(4.5, 3))
    axis.fill_between(row.curve[:, 0], row.band[:, 0], row.band[:, 1], alpha=0.3)
    axis.plot(row.curve[:, 0], row.curve[:, 1])
    axis.set_xlabel(row.variable)
    axis.set_ylabel(f"left in {row.on}")
    axis.set_title(row.words, fontsize=8)
    return _save(figure, path)


def _save(figure: Figure, path: Path) -> Path:
    figure.tight_layout()
    figure.savefig(path, dpi=150)
    plt.close(figure)
    return path
