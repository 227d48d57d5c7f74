"""Which cut-off: error of robot and load against the narrow filter's cut-off, with noise of three sizes.

    python bench/cutoff.py [STUDIES] [--markdown FILE]

Studies as in bench/coverage_study.py (white noise), times 1, 5 and 25 in the accelerometer; prints bias and rms
error in % of the true value, worst of alpha1 to alpha3 and of m, kxx, kyy, by Method 1. `--markdown` writes
JSON and a figure beside the page.
"""

import json
import sys
from pathlib import Path
from typing import Any

import coverage_study
import numpy as np
from coverage_study import ALPHA, STRUCTURE, trial, truth
from impid_host.impedance.identify import identify_load, identify_robot
from impid_host.impedance.rows import Split
from impid_host.signals.chain import DEFAULT
from matplotlib.figure import Figure

CUTOFFS_HZ = (2.0, 3.0, 4.5, 7.0, 12.0, 25.0)
NOISE = (1.0, 5.0, 25.0)
ORDINARY_M_S2 = coverage_study.ACCELERATION_M_S2


def errors(cutoff_hz: float, factor: float, studies: int) -> dict[str, np.ndarray]:
    """Relative errors, (studies, k): alpha1 to alpha3, and m, kxx, kyy."""
    chain, load = DEFAULT.with_cutoff(cutoff_hz), truth("mass-spring")
    coverage_study.ACCELERATION_M_S2 = ORDINARY_M_S2 * factor
    robot_errors, load_errors = [], []
    for seed in range(studies):
        rng = np.random.default_rng([seed, 3])
        free = [trial(rng, k, None, None)[0] for k in range(2)]
        loaded = [trial(rng, 2 + k, load, None)[0] for k in range(2)]
        robot = identify_robot(free, STRUCTURE, chain, Split())
        fit = identify_load(loaded, load[0], chain, Split(), robot=robot.parameters, handle_mass_kg=0.0)
        robot_errors.append((robot.estimate.value / ALPHA - 1)[:3])
        load_errors.append((fit.estimate.value / load[1] - 1)[:3])
    return {"alpha": np.array(robot_errors), "load": np.array(load_errors)}


def worst(error: np.ndarray) -> tuple[float, float]:
    """Bias and rms, %, of the parameter with the largest rms: (studies, k)."""
    k = int(np.argmax(np.sqrt(np.mean(error**2, axis=0))))
    return float(100 * error[:, k].mean()), float(100 * np.sqrt(np.mean(error[:, k] ** 2)))


def page(rows: list[dict[str, Any]], studies: int) -> str:
    """The Markdown page."""
    lines = [
        "# The cut-off by evidence",
        "",
        f"`python bench/cutoff.py {studies}`: {studies} studies each; accelerometer noise of 1, 5 and 25 times "
        f"{1e3 * ORDINARY_M_S2:g} mm/s² rms per sample at {coverage_study.RATE:g} Hz. Bias / rms error in %, the worst of α1 to "
        "α3, and of m, kxx, kyy by Method 1.",
        "",
        "| cut-off (Hz) | " + " | ".join(f"α, noise × {f:g} | load, noise × {f:g}" for f in NOISE) + " |",
        "| --- | " + " | ".join("---" for _ in range(2 * len(NOISE))) + " |",
    ]
    for row in rows:
        cells = [
            f"{bias:+.2f} / {rms:.2f}" for entry in row["noise"].values() for bias, rms in entry.values()
        ]
        lines.append(f"| {row['cutoff_Hz']:g} | " + " | ".join(cells) + " |")
    best = {
        (factor, part): min(rows, key=lambda row: row["noise"][factor][part][1])["cutoff_Hz"]
        for factor in rows[0]["noise"]
        for part in ("alpha", "load")
    }
    said = "; ".join(f"{part}, noise × {factor}: {cutoff:g} Hz" for (factor, part), cutoff in best.items())
    return "\n".join(
        [*lines, "", f"Smallest rms error: {said}.", "", "![Errors against cut-off](cutoff.png)", ""]
    )


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Bias and rms error against the cut-off."""
    figure = Figure(figsize=(8.4, 2.9), layout="constrained")
    cutoffs = [row["cutoff_Hz"] for row in rows]
    for panel, part in zip(figure.subplots(1, 2), ("alpha", "load"), strict=True):
        for factor, color in zip(rows[0]["noise"], ("#0072b2", "#009e73", "#d55e00"), strict=True):
            values = np.abs([row["noise"][factor][part] for row in rows])
            panel.loglog(
                cutoffs, values[:, 1], color=color, marker="o", ms=4, lw=1.0, label=f"rms, noise × {factor}"
            )
            panel.loglog(
                cutoffs, values[:, 0], color=color, ls=":", lw=1.0, label=f"|bias|, noise × {factor}"
            )
        panel.axvline(4.5, color="#bbbbbb", lw=0.8, zorder=0)
        panel.set_xticks(cutoffs, [f"{cutoff:g}" for cutoff in cutoffs])
        panel.set_xticks([], minor=True)
        panel.set(
            xlabel="cut-off (Hz)", ylabel="error (%)", title="α1 to α3" if part == "alpha" else "m, kxx, kyy"
        )
        panel.spines[["top", "right"]].set_visible(False)
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", frameon=False, fontsize=7)
    figure.savefig(path, dpi=180)


def main() -> None:
    words = sys.argv[1:]
    to = Path(words.pop(words.index("--markdown") + 1)) if "--markdown" in words else None
    words = [word for word in words if word != "--markdown"]
    studies = int(words[0]) if words else 30
    rows: list[dict[str, Any]] = []
    for cutoff in CUTOFFS_HZ:
        noise = {f"{f:g}": {k: worst(e) for k, e in errors(cutoff, f, studies).items()} for f in NOISE}
        rows.append({"cutoff_Hz": cutoff, "noise": noise})
    text = page(rows, studies)
    print(text)
    if to is not None:
        to.write_text(text, encoding="utf-8")
        document = {"command": f"python bench/cutoff.py {studies}", "bias_and_rms_percent": rows}
        to.with_suffix(".json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        draw(rows, to.with_suffix(".png"))


if __name__ == "__main__":
    main()
